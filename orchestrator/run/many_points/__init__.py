"""Many points of a scene by one call of C: `loop` one after the other, `lanes` side by side.

`rows` chooses between both. `loop` prepares the points of a scene for C, `loop_rows` runs them and makes columns of
what they recorded. `lanes` is what C is told of points in lanes, `lanes_rows` runs these, and by the loop those that
the lanes leave.
"""
