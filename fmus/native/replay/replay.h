/* The Replay component: plays the channels of a recording. */
#ifndef VIBROIMPACT_REPLAY_H
#define VIBROIMPACT_REPLAY_H

#include "recording.h"

/* The variables of a channel. */
typedef struct {
    double value, rate; /* outputs */
    int32_t valid;
    double gain, offset;
} replay_channel;

/* All of a Replay's variables (variables.toml says what each is). What follows `channels` is no part of its state. */
typedef struct {
    double time, time_shift;
    replay_channel channels[VI_REPLAY_CHANNELS];
    const vi_recording *recording; /* NULL: none is there yet */
    int described;                 /* channels in the model description; -1: it does not say */
} replay;

#endif
