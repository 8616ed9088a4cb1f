/* A recording in memory: the signal files of the folder of resources (README.md gives their format), read once. */
#ifndef VIBROIMPACT_RECORDING_H
#define VIBROIMPACT_RECORDING_H

#include <stdint.h>

#include "body/complaint.h"

enum { VI_REPLAY_CHANNELS = 256 }; /* most channels, and most axes, of a recording */

/* Instants of samples, s: evenly spaced from `start`, or listed in `times`. */
typedef struct {
    int64_t count;
    double start, interval;
    double *times; /* NULL: evenly spaced */
} vi_axis;

/* Samples `first` to `last` have no value. */
typedef struct {
    int64_t first, last;
} vi_gap;

/* A channel: a value at each instant of its axis, and the gaps in ascending order. */
typedef struct {
    int axis;
    double *values;
    vi_gap *gaps;
    int64_t gap_count;
} vi_signal;

/* Contents of the files. */
typedef struct {
    int axis_count, signal_count;
    vi_axis axes[VI_REPLAY_CHANNELS];
    vi_signal signals[VI_REPLAY_CHANNELS];
} vi_recording;

/* Read the recording in a folder of resources. Without a folder, or without signal files in it, the recording has no
 * channels. NULL, with the reason in `message`, for invalid files or when memory is out. */
vi_recording *vi_recording_open(const char *folder, char message[VI_MESSAGE_LENGTH]);

void vi_recording_close(vi_recording *recording);

#endif
