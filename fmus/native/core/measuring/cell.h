/* A load cell: its output for a given force, exact for a force that changes linearly and for the half sines of impacts.
 *
 *     y'' + 2 damping_ratio w y' + w^2 y = w^2 (force + half sines),    volts = sensitivity y + offset + drift time
 *
 * with w = 2 pi natural_frequency; for natural_frequency 0, y is the force itself. An impact on a rigid stop is a half
 * sine over `contact_duration` from the instant of impact, with the impulse of the impact. Its peak is impulse pi / (2
 * contact_duration).
 *
 * A half sine is two endless sines, the second one beginning half a turn after the first: they cancel. So all present
 * half sines are one sine with two amplitudes. Each costs the cell two instants, however many overlap.
 */
#ifndef VIBROIMPACT_CELL_H
#define VIBROIMPACT_CELL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "motion/flow.h"

/* Largest number of half sines at once. */
enum { VI_CELL_PULSES = 2048 };
/* Largest natural frequency (Hz), damping ratio and contact duration (s); a half sine then needs some thousand
 * series at most. */
enum { VI_CELL_HIGHEST = 10000000, VI_CELL_STRONGEST = 1000, VI_CELL_LONGEST = 1000 };
/* Least natural frequency and contact duration, apart from 0: their squares do not underflow. */
#define VI_CELL_LEAST 1e-9

typedef struct {
    double sensitivity;       /* V/N */
    double natural_frequency; /* Hz, 0 or VI_CELL_LEAST to VI_CELL_HIGHEST; 0: the cell does not ring */
    double damping_ratio;     /* 0 to VI_CELL_STRONGEST */
    double offset;            /* V */
    double drift;             /* V/s */
    double contact_duration;  /* s, 0 or VI_CELL_LEAST to VI_CELL_LONGEST; 0: no impacts */
} vi_cell_settings;

typedef struct {
    double end, peak; /* s, N */
} vi_pulse;

typedef struct {
    vi_cell_settings settings;
    vi_mode mode;          /* the cell without a force */
    double turn;           /* angular frequency of the half sines, rad/s */
    double time;           /* reached, s */
    double force;          /* present force without half sines, N */
    double seen, seen_rate; /* y and y', N and N/s */
    double sine, cosine;   /* present half sines: sine sin(turn u) + cosine cos(turn u), with u from now on */
    int64_t first, count;  /* present ones: pulses[first] to pulses[first + count - 1], in the order of their ends */
    vi_pulse pulses[VI_CELL_PULSES]; /* last member: only the used part is saved with a state */
} vi_cell;

/* Start the cell settled under a force at `time`. The settings must be valid. */
void vi_cell_start(vi_cell *cell, double time, double force);

/* Advance to `time`, not before the present time, under a force that changes by `slope` N/s. */
void vi_cell_advance(vi_cell *cell, double time, double slope);

/* Add an impact of this impulse, N s, now; contact_duration must be > 0. False above VI_CELL_PULSES half sines. */
bool vi_cell_hit(vi_cell *cell, double impulse);

/* Present force on the cell with half sines, N; present output of the cell, V. */
double vi_cell_load(const vi_cell *cell);
double vi_cell_volts(const vi_cell *cell);

/* Bytes of unused half sines at the end of the cell. */
size_t vi_cell_unused(const vi_cell *cell);

#endif
