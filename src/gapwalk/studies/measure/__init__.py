"""A record beside a computed motion: the table [measurement] of a model file, and the job."""
