"""The camera: pinhole, lens models and their files, rotation, similarity, boards."""
