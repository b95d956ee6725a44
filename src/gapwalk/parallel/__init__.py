"""Where work is done: pieces on local cores or on a cluster, and how far it has come."""
