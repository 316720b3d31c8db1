"""``calib-inspect live``: move an extrinsic by hand, and see what the cascade answers.

`workspace` holds what is tried, `session` acts on what the page asks for, `worker` computes beside it, `stream` records
every try for the viewer, and `app` connects them to the page in `page/`.
"""
