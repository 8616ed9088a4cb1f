#include "lanes/sampling.h"

#include <math.h>

#include "lanes/lane_state.h"
#include "lanes/lane_turn.h"
#include "motion/clock.h"
#include "motion/majorant.h"

/* Relative excess over the last sample that counts as rounding of the recording's length. */
static const double LAST = 1e-12;

static vi_clock clock_of(const vi_lane_group *g, int lane)
{
    return (vi_clock){g->angular_frequency[lane], g->period[lane], g->period_low[lane], g->record.origin[lane],
                      g->record.origin_low[lane]};
}

/* Set the time of the next sample. */
static void set_next(vi_lane_group *g, const vi_lanes_plan *plan, const vi_lanes_points *points, int lane, double number)
{
    const int64_t point = (int64_t)g->record.point[lane];
    g->samples.next[lane] = number;
    g->samples.time[lane] = vi_min(points->begin[point] + number / plan->rate, points->end[point]);
}

int vi_lane_sampled(const vi_lanes_plan *plan, int sampled[VI_POINTS])
{
    int count = 0;
    for (int point = 0; point < VI_POINTS; ++point) {
        if ((plan->sampled >> point) & 1) {
            sampled[count++] = point;
        }
    }
    return count;
}

bool vi_lane_begin_samples(vi_lane_group *g, const vi_lanes_plan *plan, const vi_lanes_points *points, int lane)
{
    const int64_t point = (int64_t)g->record.point[lane];
    const double count = floor((points->end[point] - points->begin[point]) * plan->rate * (1.0 + LAST)) + 1.0;
    if (!(count <= (double)points->most_samples)) {
        return false;
    }
    g->samples.count[lane] = count;
    set_next(g, plan, points, lane, 0.0);
    return true;
}

void vi_lane_write_sample(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int lane,
                          const double displacement[], const double velocity[])
{
    const int64_t point = (int64_t)g->record.point[lane], n = (int64_t)g->samples.next[lane];
    const int64_t row = points->count * points->most_samples;
    double *sample = points->samples + point * points->most_samples + n;
    for (int64_t left = plan->sampled, k = 0; left > 0; left >>= 1) {
        if (left & 1) {
            sample[2 * k * row] = displacement[k];
            sample[(2 * k + 1) * row] = velocity[k];
            k += 1;
        }
    }
    points->samples_of[point] = n + 1;
    set_next(g, plan, points, lane, g->samples.next[lane] + 1.0);
}

/* ---- bodies of one mode ---- */

void vi_lane_sample_from(vi_lane_group *g, int lane, int modes)
{
    (void)modes;
    vi_lane_samples *samples = &g->samples;
    samples->from_q[lane] = g->q[0][lane];
    samples->from_p[lane] = g->p[0][lane];
    vi_lane_turn(g->angular_frequency[lane] * g->rest[lane], &samples->from_cosine[lane], &samples->from_sine[lane]);
    samples->from_periods[lane] = g->periods[lane];
    samples->from_rest[lane] = g->rest[lane];
    samples->from_rest_low[lane] = g->rest_low[lane];
    samples->from_pressed[lane] = g->yielding.pressed_stop[lane];
}

/* The phase of a lane since its samples were last taken: its tables, and the way from its state to q. */
typedef struct {
    const vi_one_mode *tables;
    double cell, rate;        /* length of a cell, s, and its reciprocal */
    double sign, level;       /* q = sign * (level + state) */
    double most, least;       /* of q, between rigid stops */
    double shape[VI_POINTS];  /* of the sampled points */
    int sampled;
} sampled_phase;

static sampled_phase phase_of_lane(const vi_lane_group *g, const vi_lanes_plan *plan, const vi_lanes_points *points,
                                   int lane)
{
    const int64_t point = (int64_t)g->record.point[lane];
    const int pressed = (int)g->samples.from_pressed[lane];
    sampled_phase phase = {&g->one, g->one.span[lane] / VI_CELLS, VI_CELLS / g->one.span[lane], 1.0, 0.0,
                           HUGE_VAL, -HUGE_VAL, {0.0}, 0};
    int sampled[VI_POINTS];
    phase.sampled = vi_lane_sampled(plan, sampled);
    for (int k = 0; k < phase.sampled; ++k) {
        phase.shape[k] = sampled[k] == VI_LANES_CONTACTS ? points->observed[point]
                                                         : points->shape[sampled[k] * points->count + point];
    }
    if (pressed > 0) {
        const int c = pressed - 1;
        phase.tables = &g->yielding.pressed[c];
        phase.cell = g->yielding.cell[pressed][lane];
        phase.rate = g->yielding.cell_rate[pressed][lane];
        phase.sign = g->sign[c][lane];
        phase.level = g->limit[c][lane];
        return phase;
    }
    for (int c = 0; c < plan->contacts && c < VI_ONE_MODE_CONTACTS; ++c) { /* nearest contacts come first */
        if (g->yielding.yields[c][lane] == 0.0 && g->sign[c][lane] > 0.0) {
            phase.most = vi_min(phase.most, g->limit[c][lane]);
        } else if (g->yielding.yields[c][lane] == 0.0) {
            phase.least = vi_max(phase.least, -g->limit[c][lane]);
        }
    }
    return phase;
}

static void write_sample(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int lane,
                         const sampled_phase *phase, double state, double rate)
{
    const double q = vi_max(phase->least, vi_min(phase->most, phase->sign * (phase->level + state)));
    double displacement[VI_POINTS], velocity[VI_POINTS];
    for (int k = 0; k < phase->sampled; ++k) {
        displacement[k] = phase->shape[k] * q;
        velocity[k] = phase->shape[k] * (phase->sign * rate);
    }
    vi_lane_write_sample(g, plan, points, lane, displacement, velocity);
}

void vi_lane_take_samples(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int lane)
{
    vi_lane_samples *samples = &g->samples;
    const vi_clock clock = clock_of(g, lane);
    const vi_instant zero = {0, clock.origin, clock.origin_low};
    const vi_instant from = {(int64_t)samples->from_periods[lane], samples->from_rest[lane], samples->from_rest_low[lane]};
    const vi_instant now = {(int64_t)g->periods[lane], g->rest[lane], g->rest_low[lane]};
    double low;
    const double high = vi_clock_elapsed_twofold(&clock, zero, from, &low), length = vi_clock_elapsed(&clock, from, now);
    const double slack = VI_ROUNDING_OF_TIME * (fabs(high) + length);
    const sampled_phase phase = phase_of_lane(g, plan, points, lane);
    vi_lane_state state = {samples->from_q[lane], samples->from_p[lane], samples->from_cosine[lane],
                           samples->from_sine[lane]};
    vi_lane_cell cell = {.order = VI_LANE_ORDER};
    vi_lane_phases phases = vi_lane_phases_at(g, lane, samples->from_periods[lane], samples->from_rest[lane]);
    double value, slope;
    int64_t passed = 0, expanded = -1; /* cells before `state`; the cell that is expanded */
    while (samples->next[lane] < samples->count[lane]) {
        const double offset = (samples->time[lane] - high) - low;
        if (!(offset <= length + slack)) {
            return;
        }
        const double cells = vi_max(0.0, vi_min(offset, length)) * phase.rate;
        const int64_t whole = (int64_t)cells;
        for (; passed + VI_CELLS <= whole; passed += VI_CELLS) {
            state = vi_lane_after_cells(phase.tables, lane, &state, VI_CELLS);
            vi_lane_state_add_sines(&state, g, lane, VI_CELLS, &phases);
            phases = vi_lane_phases_at(g, lane, samples->from_periods[lane],
                                       samples->from_rest[lane] + (double)(passed + VI_CELLS) * phase.cell);
        }
        if (whole != expanded) {
            const double rest = samples->from_rest[lane] + (double)whole * phase.cell;
            vi_lane_state start = vi_lane_after_cells(phase.tables, lane, &state, (int)(whole - passed));
            vi_lane_state_add_sines(&start, g, lane, (int)(whole - passed), &phases);
            const vi_lane_phases there = vi_lane_phases_at(g, lane, samples->from_periods[lane], rest);
            cell = vi_lane_cell_from(phase.tables, lane, &start, phase.cell);
            vi_lane_cell_add_sines(&cell, g, lane, &there);
            expanded = whole;
        }
        vi_lane_cell_at(&cell, cells - (double)whole, &value, &slope);
        write_sample(g, plan, points, lane, &phase, value, slope * phase.rate);
    }
}
