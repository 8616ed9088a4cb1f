/* Value of a channel of a recording at a time: a function of the time alone, linear between samples. */
#ifndef VIBROIMPACT_PLAYER_H
#define VIBROIMPACT_PLAYER_H

#include <stdbool.h>

#include "recording.h"

/* Place of a time on an axis: `since` seconds after sample `index`, or at it, or outside the record. */
typedef struct {
    int64_t index;
    double since;
    bool on_sample, outside;
} vi_place;

/* Value, slope of the segment that begins (1/s), and whether the value was measured. */
typedef struct {
    double value, rate;
    bool valid;
} vi_playing;

/* The place of a finite time, s, on an axis. */
vi_place vi_axis_place(const vi_axis *axis, double time);

/* The signal at a place of its axis. */
vi_playing vi_signal_at(const vi_signal *signal, const vi_axis *axis, const vi_place *place);

#endif
