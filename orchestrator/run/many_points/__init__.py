"""Many points of a scene by one call of C: `loop` one after the other, `lanes` side by side.

`rows` chooses between both. `loop` prepares the points of a scene for C, `loop_rows` runs them and makes columns of
their records. `lanes` prepares points in lanes for C, `lanes_rows` runs them. Points that the lanes leave out run by
the loop.
"""
