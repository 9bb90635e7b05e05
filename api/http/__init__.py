"""The HTTP service: runs, samples and findings by REST under /api/v1, the bench page for people."""
