/* The functions that vibroimpact.fmus.core calls for signals of time: their values and pieces, as in the FMUs. */
#ifndef VIBROIMPACT_DOOR_SIGNALS_H
#define VIBROIMPACT_DOOR_SIGNALS_H

#include <stddef.h>
#include <stdint.h>

#include "body/complaint.h"
#include "signals/signal.h"

typedef struct {
    int64_t kind; /* vi_signal_kind */
    double start, duration, angular_frequency, end_angular_frequency, phase, rise; /* as in vi_signal */
    uint64_t seed;
    int64_t count;             /* of the table, 0: none */
    const double *time, *value;
} vi_door_signal_settings;

/* A signal with its memory. */
typedef struct vi_door_signal vi_door_signal;

size_t vi_door_signal_size(void);

/* Start a signal of amplitude 1. Returns 0, or 1 with the reason in `message`. */
int vi_door_signal_start(vi_door_signal *memory, const vi_door_signal_settings *settings,
                         char message[VI_MESSAGE_LENGTH]);

/* Values at times[] + low[], s. */
void vi_door_signal_values(vi_door_signal *memory, size_t count, const double times[], const double low[],
                           double values[]);

/* Pieces from `begin` on, until one reaches `end` or `room` is used up: start (two numbers), length and coefficients of
 * each. Returns their number. */
size_t vi_door_signal_pieces(vi_door_signal *memory, double begin, double end, size_t room, double start[][2],
                             double length[], double coefficient[][VI_PIECE_DEGREE + 1]);

#endif
