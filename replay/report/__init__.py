"""The report: one HTML file without network access, one module and one template per section."""
