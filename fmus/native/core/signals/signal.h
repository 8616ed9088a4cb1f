/* Signals of time, of amplitude 1: chirps, pulses, tables and random ones, as polynomials on segments.
 *
 * A signal is 0 before its start and after its end. Its pieces end at its kinks exactly: an instant within two units in
 * the last place before a kink is past it.
 */
#ifndef VIBROIMPACT_SIGNAL_H
#define VIBROIMPACT_SIGNAL_H

#include <stdint.h>

#include "signals/chirp.h"
#include "signals/piece.h"
#include "signals/random.h"
#include "signals/table.h"
#include "signals/transform.h"

typedef enum {
    VI_NO_SIGNAL = 0, /* 0 at all times */
    VI_CHIRP_LINEAR = 1,
    VI_CHIRP_LOGARITHMIC = 2,
    VI_HALF_SINE = 3,
    VI_TRIANGLE = 4,
    VI_TRAPEZOID = 5,
    VI_TABLE_LINEAR = 6,
    VI_RANDOM = 7,
    VI_TABLE_CUBIC = 8
} vi_signal_kind;

/* The kind of a number from outside; an unknown number is that of no kind. */
static inline vi_signal_kind vi_signal_kind_of(int64_t number)
{
    return (vi_signal_kind)(number >= VI_NO_SIGNAL && number <= VI_TABLE_CUBIC ? number : VI_TABLE_CUBIC + 1);
}

/* Most instants of a pulse. */
enum { VI_PULSE_POINTS = 4 };

/* A signal; its arrays belong to the caller. */
typedef struct {
    vi_signal_kind kind;
    double start;          /* s; times of tables count from here */
    double duration;       /* s, > 0; not of tables; random: 0 is without end */
    double angular_frequency, end_angular_frequency; /* rad/s: of a chirp at its start and end; band of a random one */
    double phase;          /* of a chirp at its start, rad */
    double rise;           /* of a trapezoid, and its fall, s, 0 to duration / 2 */
    uint64_t seed;
    vi_table table;        /* of a table, or the density of a random signal over rad/s, count 0: 1 / band */
    vi_random *random;     /* memory of a random signal */
    vi_transform *transform; /* shared by random signals */
    /* derived by vi_signal_prepare */
    vi_chirp chirp;
    double knot[VI_PULSE_POINTS], height[VI_PULSE_POINTS]; /* of a triangle or a trapezoid */
} vi_signal;

/* A density of a random signal; without a band of its own it covers the table. */
vi_density vi_signal_density(const vi_signal *signal);

/* Derive the remaining members of a valid signal. The `bend` of a cubic table is found by vi_table_bend. */
void vi_signal_prepare(vi_signal *signal);

/* The piece at `time`, s. */
void vi_signal_piece(vi_signal *signal, vi_twofold time, vi_piece *piece);

#endif
