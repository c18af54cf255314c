"""The concealed trial: does the diagnosis name what an independent program hid?

A *trial* is one data set of a concealed rig. Its truth is drawn, written and hashed first; another process gets the recordings
and nothing else; only then is the seal opened, the hash checked and the answer judged.
"""
