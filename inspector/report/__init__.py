"""A report of a run as a static folder, made from its recording alone: page, pictures, figures as JSON."""
