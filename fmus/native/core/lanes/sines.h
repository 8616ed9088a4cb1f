/* The phases of the further sines of the lanes, and their shares of a motion. For any width of vectors.
 *
 * The phase of a sine is its fraction of a turn at the start of a period of the clock, and its turns since then. So the
 * phase in the 10^6th period is as exact as in the first.
 */
#ifndef VIBROIMPACT_LANE_FURTHER_SINES_H
#define VIBROIMPACT_LANE_FURTHER_SINES_H

#include "lanes/lane_group.h"
#include "lanes/vector.h"

/* Cosines and sines of the phases of further sines. */
typedef struct {
    vector cosine[VI_FURTHER_SINES], sine[VI_FURTHER_SINES];
} phases;

/* Set the phase of a sine with these numbers at an instant. */
LANES_INLINE void phase_at(const vector turns[3], vector turn, vector rate, vector periods, vector rest, vector *cosine,
                           vector *sine)
{
    const vector steps = periods * turns[0], whole = (steps + WHOLE) - WHOLE;
    const vector begun = (steps - whole) + (periods * turns[1] + (periods * turns[2] + turn));
    turn_by(begun + rest * rate, cosine, sine);
}

/* Set the phases of the lanes at their own instants. */
LANES_INLINE void phases_at(const vi_lane_group *g, int at, int further, vector periods, vector rest, phases *of)
{
    for (int k = 0; k < further; ++k) {
        const vi_lane_sines *s = g->sines;
        const vector turns[3] = {load(s->turns[k][0] + at), load(s->turns[k][1] + at), load(s->turns[k][2] + at)};
        phase_at(turns, load(s->turn[k] + at), load(s->rate[k] + at), periods, rest, &of->cosine[k], &of->sine[k]);
    }
}

/* Set the powers of the clock's turn that the harmonics of each lane are. */
LANES_INLINE void powers_of(const vi_lane_sines *s, int at, int further, vector cosine, vector sine, phases *power)
{
    vector c = cosine, n = sine;
    for (int k = 0; k < further; ++k) {
        power->cosine[k] = cosine;
        power->sine[k] = sine;
    }
    for (int64_t order = 2; order <= s->highest; ++order) {
        const vector next = c * cosine - n * sine;
        n = n * cosine + c * sine;
        c = next;
        for (int k = 0; k < further; ++k) {
            const mask here = load(s->harmonic[k] + at) == (double)order;
            power->cosine[k] = choose(here, c, power->cosine[k]);
            power->sine[k] = choose(here, n, power->sine[k]);
        }
    }
}

/* Set the phases at the start of a round, where the clock's phase has this cosine and sine. Harmonics are powers of its
 * turn. */
LANES_INLINE void phases_of_round(const vi_lane_group *g, int at, int further, vector cosine, vector sine, phases *of)
{
    const vi_lane_sines *s = g->sines;
    if (!further) {
        return;
    }
    phases power;
    const vector periods = load(g->periods + at), rest = load(g->rest + at);
    const vector turned = 6.283185307179586232 * periods + load(g->angular_frequency + at) * rest;
    powers_of(s, at, further, cosine, sine, &power);
    for (int k = 0; k < further; ++k) {
        const vector drift = load(s->drift[k] + at) * turned, less = 1.0 - 0.5 * drift * drift;
        const vector c = load(s->start_cosine[k] + at), n = load(s->start_sine[k] + at);
        const vector start_c = c * less - n * drift, start_n = n * less + c * drift;
        of->cosine[k] = start_c * power.cosine[k] - start_n * power.sine[k];
        of->sine[k] = start_n * power.cosine[k] + start_c * power.sine[k];
    }
    if (s->others > 0) {
        phases counted;
        phases_at(g, at, further, periods, rest, &counted);
        for (int k = 0; k < further; ++k) {
            const mask harmonic = load(s->harmonic[k] + at) > 0.0;
            of->cosine[k] = choose(harmonic, of->cosine[k], counted.cosine[k]);
            of->sine[k] = choose(harmonic, of->sine[k], counted.sine[k]);
        }
    }
}

/* Set the phases of one lane at several instants. */
LANES_INLINE void phases_of_lane(const vi_lane_group *g, int lane, int further, vector periods, vector rest, phases *of)
{
    for (int k = 0; k < further; ++k) {
        const vi_lane_sines *s = g->sines;
        const vector turns[3] = {all(s->turns[k][0][lane]), all(s->turns[k][1][lane]), all(s->turns[k][2][lane])};
        phase_at(turns, all(s->turn[k][lane]), all(s->rate[k][lane]), periods, rest, &of->cosine[k], &of->sine[k]);
    }
}

/* Set the modes of the further sines, after the `own` modes of a body of several modes: cos(phase) and sin(phase). So
 * they are exact at the start of each round. */
LANES_INLINE void set_sines(vi_lane_group *g, int at, int own, int further)
{
    phases of;
    phases_at(g, at, further, load(g->periods + at), load(g->rest + at), &of);
    for (int k = 0; k < further; ++k) {
        const vector w = load(g->sines->angular_frequency[k] + at);
        const int cosine = own + 2 * k, sine = cosine + 1;
        store(g->q[cosine] + at, of.cosine[k]);
        store(g->p[cosine] + at, -(w * of.sine[k]));
        store(g->q[sine] + at, of.sine[k]);
        store(g->p[sine] + at, w * of.cosine[k]);
    }
}

/* Add the shares of the further sines to the value of a row of a table. */
LANES_INLINE void add_sines(const vi_lane_array row[VI_FURTHER_SINES][VI_SINE_PARTS], int at, int further,
                            const phases *of, vector *value)
{
    for (int k = 0; k < further; ++k) {
        *value += load(row[k][VI_OF_ITS_COSINE] + at) * of->cosine[k] + load(row[k][VI_OF_ITS_SINE] + at) * of->sine[k];
    }
}

/* The same for several rows and one lane. */
LANES_INLINE void add_sines_of_lane(const vi_lane_array table[][VI_FURTHER_SINES][VI_SINE_PARTS], int count, int lane,
                                    int further, const phases *of, vector value[])
{
    for (int k = 0; k < further; ++k) {
        const vector c = of->cosine[k], n = of->sine[k];
#pragma GCC unroll 16
        for (int i = 0; i < count; ++i) {
            value[i] += table[i][k][VI_OF_ITS_COSINE][lane] * c + table[i][k][VI_OF_ITS_SINE][lane] * n;
        }
    }
}

#endif
