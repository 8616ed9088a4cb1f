/* Rows of a vector of lanes: impacts and periods. For any width of vectors, so that lockstep and single lanes write the
 * same bits. */
#ifndef VIBROIMPACT_LANE_RECORDING_H
#define VIBROIMPACT_LANE_RECORDING_H

#include <string.h>

#include "lanes/lane_group.h"
#include "lanes/vector.h"

/* Twice the digits: the rounding error of the product `product` = a * b (Dekker). */
LANES_INLINE vector error_of_product(vector a, vector b, vector product)
{
    const vector a_split = 134217729.0 * a, b_split = 134217729.0 * b; /* 2^27 + 1 */
    const vector a_high = a_split - (a_split - a), b_high = b_split - (b_split - b);
    const vector a_low = a - a_high, b_low = b - b_high;
    return ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low;
}

/* Time of some instants, s, in two parts: vi_clock_elapsed_twofold from time 0. */
LANES_INLINE vector twofold_time_of(const vi_lane_group *g, int at, vector count, vector rest, vector rest_low,
                                    vector *low)
{
    const vector period = load(g->period + at), origin = load(g->record.origin + at), whole = count * period;
    *low = error_of_product(count, period, whole) + count * load(g->period_low + at)
           - load(g->record.origin_low + at) + rest_low;
    const vector sum = whole + rest, shifted = sum - origin;
    *low += error_of_sum(whole, rest, sum);
    *low += error_of_sum(sum, -origin, shifted);
    return shifted;
}

/* Time of the present instants, s: vi_clock_time. */
LANES_INLINE vector time_of(const vi_lane_group *g, int at)
{
    vector low;
    const vector high = twofold_time_of(g, at, load(g->periods + at), load(g->rest + at), load(g->rest_low + at), &low);
    return high + low;
}

/* Phase of the force at the present instants, rad: vi_clock_phase. */
LANES_INLINE vector phase_of(const vi_lane_group *g, int at)
{
    const vector w = load(g->angular_frequency + at), phase = w * load(g->rest + at);
    return choose(w == 0.0, all((double)NAN), only(phase < 6.283185307179586232, phase));
}

/* Write the impacts at which some lanes are. */
LANES_INLINE void write_impacts(const vi_lane_group *g, vi_lanes_points *points, int at, int contacts, mask hits)
{
    const vector number = load(g->hit + at);
    vector unit = all(1.0), impulse = unit, restitution = all(0.0), yields = restitution, contact = restitution;
    for (int c = 0; c < contacts; ++c) {
        const mask here = number == (double)(c + 1);
        unit = choose(here, load(g->record.unit[c] + at), unit);
        impulse = choose(here, load(g->record.impulse[c] + at), impulse);
        restitution = choose(here, load(g->restitution[c] + at), restitution);
        yields = choose(here, load(g->yield_velocity[c] + at), yields);
        contact = choose(here, load(g->record.number[c] + at), contact);
    }
    const vector speed = load(g->approach + at) * unit;
    yields = yields * unit;
    const mask softer = hits & (yields > 0.0) & (speed > yields);
    if (any(softer)) {
        restitution = choose(softer, restitution / root(root(speed / yields)), restitution);
    }
    const vector row[VI_IMPACT_WIDTH] = {time_of(g, at), phase_of(g, at), speed, (1.0 + restitution) * speed * impulse,
                                         contact, restitution, all(0.0), all((double)NAN)};
    double *rows = points->rows + points->rows_used * VI_IMPACT_WIDTH;
    for (int i = 0; i < VI_WIDTH; ++i) {
        if (hits[i]) {
            for (int column = 0; column < VI_IMPACT_WIDTH; ++column) {
                rows[column] = row[column][i];
            }
            const int64_t point = (int64_t)g->record.point[at + i];
            rows += VI_IMPACT_WIDTH;
            points->owner[points->rows_used++] = point;
            points->rows_of[point] += 1;
        }
    }
}

/* Write a period that ends, or join it to those before. */
static inline void put_period(const vi_lanes_plan *plan, vi_lanes_points *points, int64_t point,
                              const double period[VI_PERIOD_WIDTH])
{
    const int64_t done = points->periods_of[point]++, column = points->count * points->most_periods;
    double *row = points->periods + point * points->most_periods;
    if (plan->each_period || done == 0) {
        row += plan->each_period ? done : 0;
        for (int i = 0; i < VI_PERIOD_WIDTH; ++i) {
            row[i * column] = period[i];
        }
        return;
    }
    double *largest = row + VI_OF_LARGEST * column, *smallest = row + VI_OF_SMALLEST * column;
    *largest = period[VI_OF_LARGEST] > *largest ? period[VI_OF_LARGEST] : *largest;
    *smallest = period[VI_OF_SMALLEST] < *smallest ? period[VI_OF_SMALLEST] : *smallest;
    row[VI_OF_STROBE * column] = period[VI_OF_STROBE];
    row[VI_OF_STROBE_VELOCITY * column] = period[VI_OF_STROBE_VELOCITY];
    row[VI_OF_IMPACTS * column] += period[VI_OF_IMPACTS]; /* a sum until the end of the run */
}

/* Write the open periods of some lanes, which end. */
LANES_INLINE void end_periods(const vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int at,
                              mask turns)
{
    const vi_lane_record *r = &g->record;
    const vector scale = load(r->scale + at), a = scale * load(r->most + at), b = scale * load(r->least + at);
    vector column[VI_PERIOD_WIDTH];
    column[VI_OF_LARGEST] = larger(a, b);
    column[VI_OF_SMALLEST] = smaller(a, b);
    column[VI_OF_STROBE] = scale * load(r->strobe + at);
    column[VI_OF_STROBE_VELOCITY] = scale * load(r->strobe_velocity + at);
    column[VI_OF_IMPACTS] = load(g->impacts + at) - load(r->impacts_before + at);
    for (int i = 0; i < VI_WIDTH; ++i) {
        if (turns[i]) {
            double period[VI_PERIOD_WIDTH];
            for (int c = 0; c < VI_PERIOD_WIDTH; ++c) {
                period[c] = column[c][i];
            }
            put_period(plan, points, (int64_t)r->point[at + i], period);
        }
    }
}

/* Begin a period in some lanes, in this state of the observed point. */
LANES_INLINE void begin_periods(vi_lane_group *g, int at, mask turns, vector displacement, vector velocity)
{
    vi_lane_record *r = &g->record;
    const vector extreme = choose(load(r->extremes + at) > 0.0, displacement, all((double)NAN));
    store(r->most + at, choose(turns, extreme, load(r->most + at)));
    store(r->least + at, choose(turns, extreme, load(r->least + at)));
    store(r->strobe + at, choose(turns, displacement, load(r->strobe + at)));
    store(r->strobe_velocity + at, choose(turns, velocity, load(r->strobe_velocity + at)));
    store(r->impacts_before + at, choose(turns, load(g->impacts + at), load(r->impacts_before + at)));
}

#endif
