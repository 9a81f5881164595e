"""Files and messages: bags, CSV and MTi records, model files, exports, names of topics. Everything that is read is
checked here, so that the rooms above get values they can use.
"""
