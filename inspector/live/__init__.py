"""``calib-inspect live``: move an extrinsic by hand, and see the cascade's answer.

`workspace` holds the state, `session` acts on requests from the page, `worker` computes in a thread of its own,
`stream` records every try for the viewer, and `app` connects them to the page in `page/`.
"""
