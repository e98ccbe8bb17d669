"""Reports of both packages: blocks in, HTML or PDF out, words in three languages."""
