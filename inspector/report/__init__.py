"""Reports of runs as static folders, made from recordings alone: page, pictures, and figures as JSON."""
