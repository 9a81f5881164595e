"""What people read: tables, figures, pages. Takes results and computes nothing of its own."""
