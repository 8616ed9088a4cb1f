/* A load cell: what it makes of the force on it, exact for a force that goes straight and for the half sines of impacts.
 *
 *     y'' + 2 damping_ratio w y' + w^2 y = w^2 (force + half sines),    volts = sensitivity y + offset + drift time
 *
 * with w = 2 pi natural_frequency; natural_frequency 0: y is the force itself. An impact on a rigid stop is a half sine of
 * `contact_duration` that begins with it and has its impulse: its peak is impulse pi / (2 contact_duration).
 *
 * A half sine is two endless sines, the second begun when the first has made half a turn: they cancel. So all half sines that
 * are under way are one sine of two amplitudes, and each costs the cell two instants, however many overlap.
 */
#ifndef VIBROIMPACT_CELL_H
#define VIBROIMPACT_CELL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "motion/flow.h"

/* Half sines that may be under way at once. */
enum { VI_CELL_PULSES = 2048 };
/* Largest natural frequency (Hz), damping ratio and contact duration (s): no half sine then takes more than some thousand series. */
enum { VI_CELL_HIGHEST = 10000000, VI_CELL_STRONGEST = 1000, VI_CELL_LONGEST = 1000 };
/* Least natural frequency and contact duration but 0: their squares are numbers. */
#define VI_CELL_LEAST 1e-9

typedef struct {
    double sensitivity;       /* V/N */
    double natural_frequency; /* Hz, 0 or VI_CELL_LEAST to VI_CELL_HIGHEST; 0: none */
    double damping_ratio;     /* 0 to VI_CELL_STRONGEST */
    double offset;            /* V */
    double drift;             /* V/s */
    double contact_duration;  /* s, 0 or VI_CELL_LEAST to VI_CELL_LONGEST; 0: no impacts come */
} vi_cell_settings;

typedef struct {
    double end, peak; /* s, N */
} vi_pulse;

typedef struct {
    vi_cell_settings settings;
    vi_mode mode;          /* the cell, not forced */
    double turn;           /* angular frequency of the half sines, rad/s */
    double time;           /* reached, s */
    double force;          /* now, N, without half sines */
    double seen, seen_rate; /* y and y', N and N/s */
    double sine, cosine;   /* half sines under way: sine sin(turn u) + cosine cos(turn u), u from now on */
    int64_t first, count;  /* those under way: pulses[first] to pulses[first + count - 1], in the order of their ends */
    vi_pulse pulses[VI_CELL_PULSES]; /* last: only the used part is saved with a state */
} vi_cell;

/* Settled under a force at `time`. The settings are good. */
void vi_cell_start(vi_cell *cell, double time, double force);

/* Go on to `time` >= that reached, under a force that changes by `slope` N/s. */
void vi_cell_advance(vi_cell *cell, double time, double slope);

/* An impact of this impulse, N s, now; contact_duration is > 0. False when VI_CELL_PULSES are under way. */
bool vi_cell_hit(vi_cell *cell, double impulse);

/* What is on the cell now, half sines too, N; and its output, V. */
double vi_cell_load(const vi_cell *cell);
double vi_cell_volts(const vi_cell *cell);

/* Bytes at the end of the cell that hold no half sines. */
size_t vi_cell_unused(const vi_cell *cell);

#endif
