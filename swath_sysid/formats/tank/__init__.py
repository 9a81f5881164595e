"""Files of data acquisition: each module finds the named columns of one format.

`formats.registry` names them, and the site shows what their docstrings say.
"""
