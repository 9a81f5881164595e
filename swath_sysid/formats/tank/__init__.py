"""Files of data acquisition: each module finds the named columns of one format."""
