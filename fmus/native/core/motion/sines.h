/* Sines besides the clock's, at any frequencies. Phases are counted as the clock counts time. At the start of period n
 * the phase is the fraction of n times the turns in a period. So the 10^6th period is as exact as the first.
 */
#ifndef VIBROIMPACT_SINES_H
#define VIBROIMPACT_SINES_H

#include "motion/clock.h"
#include "motion/segment.h"

typedef struct {
    double angular_frequency; /* rad/s, > 0 */
    double turns, turns_low;  /* of this sine in a period of the clock; their sum has twice the digits */
    double start, start_low;  /* turns at the clock's origin, 0 <= start < 1 */
    int64_t harmonic;         /* turns, where they are a whole number to rounding; else 0. 64 bits, to avoid padding */
    double drift;             /* of a harmonic, rad in a period of the clock: 2 pi (turns - harmonic) */
} vi_sine;

/* Phases of harmonics where the clock's phase is 0, at the start of a block of periods. */
typedef struct {
    int64_t first; /* period of the block; INT64_MAX: none is known */
    vi_phase phase[VI_SINES_ROOM];
} vi_sine_block;

/* Start a sine of this phase, rad, at time 0. */
vi_sine vi_sine_start(const vi_clock *clock, double angular_frequency, double phase);

/* The sine of another frequency, or on a retuned clock, that has this phase, rad, at the instant. */
vi_sine vi_sine_from(const vi_clock *clock, double angular_frequency, vi_instant instant, double phase);

/* Phase at an instant, rad, with its cosine and sine. */
vi_phase vi_sine_phase(const vi_sine *sine, vi_instant instant);

/* Phases of sines at an instant, at which the clock has this phase: those of harmonics by powers of its turn. They follow
 * from the instant alone; the block only keeps what many instants need. */
void vi_sine_phases(const vi_sine sine[], int count, const vi_clock *clock, vi_instant instant, vi_phase of_clock,
                    vi_sine_block *block, vi_phase phase[]);

/* Powers of a turn, in ascending order: cosine and sine of `order` times its angle. */
typedef struct {
    int64_t order;
    double cosine, sine;
} vi_turns;

/* Turn phase by `harmonic` times the angle with this cosine and sine; `turns` has the power of the last harmonic. Its
 * angle is left. */
static inline void vi_turn_harmonic(vi_phase *phase, int64_t harmonic, double cosine, double sine, vi_turns *turns)
{
    if (harmonic < turns->order) {
        *turns = (vi_turns){1, cosine, sine};
    }
    for (; turns->order < harmonic; ++turns->order) {
        const double turned = turns->cosine * cosine - turns->sine * sine;
        turns->sine = turns->sine * cosine + turns->cosine * sine;
        turns->cosine = turned;
    }
    const double c = phase->cosine * turns->cosine - phase->sine * turns->sine;
    phase->sine = phase->sine * turns->cosine + phase->cosine * turns->sine;
    phase->cosine = c;
}

#endif
