"""Any readable log to another format."""
