"""The command line, one verb a file: parse, delegate, print. What a verb does can be done from Python without it."""
