"""What several tests build or call."""
