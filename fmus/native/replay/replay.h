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

/* All variables of a Replay, described in variables.toml. Members after `channels` are no part of its state. */
typedef struct {
    double time, time_shift;
    replay_channel channels[VI_REPLAY_CHANNELS];
    const vi_recording *recording; /* NULL: not given yet */
    int described;                 /* channels in the model description; -1: unknown */
} replay;

#endif
