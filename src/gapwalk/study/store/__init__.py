"""Where results are kept: files that grow by whole parts and are read back bit for bit."""
