/* Samples of bodies of several modes in a round, in all lanes at once; they change nothing of its motion. For any width
 * of vectors, so that lockstep and single lanes take the same samples. */
#include "lanes/many_search.h"

/* The lanes on their way through a round: the state some shortest cells after its start. */
typedef struct {
    modal_state state;
    vector passed;
} sampled_flight;

/* Terms of the displacements of the sampled points over the shortest cell that begins there. */
typedef struct {
    int count, point[VI_POINTS];
    vector term[VI_POINTS][VI_LANE_ORDER + 1];
} sampled_motion;

/* Times from the start of a round, s: to the next sample, and to the end of the round. */
typedef struct {
    vector high, low; /* time of the start */
    vector length, slack;
} sampled_round;

LANES_INLINE sampled_round sampled_round_of(const vi_lane_group *g, int at)
{
    const vi_lane_samples *from = &g->samples;
    const vector count = load(from->from_periods + at), rest = load(from->from_rest + at);
    const vector rest_low = load(from->from_rest_low + at), whole = load(g->periods + at) - count;
    sampled_round r;
    r.high = twofold_time_of(g, at, count, rest, rest_low, &r.low);
    r.length = (whole * load(g->period + at) + (load(g->rest + at) - rest))
               + (whole * load(g->period_low + at) + (load(g->rest_low + at) - rest_low));
    r.slack = VI_ROUNDING_OF_TIME * (size_of(r.high) + r.length);
    return r;
}

/* Lanes whose next sample is in the round. `offset`: its time from the start of the round, s. */
LANES_INLINE mask next_in_round(const vi_lane_group *g, int at, const sampled_round *r, vector *offset)
{
    *offset = (load(g->samples.time + at) - r->high) - r->low;
    return (load(g->samples.next + at) < load(g->samples.count + at)) & (*offset <= r->length + r->slack);
}

/* Step on by these tables in some lanes. */
LANES_INLINE void step_some(int at, int modes, const vi_lane_array step[][4], const double turn_cosine[],
                            const double turn_sine[], mask where, modal_state *s)
{
    modal_state next;
    step_on(at, modes, step, turn_cosine, turn_sine, s, &next);
    for (int j = 0; j < modes; ++j) {
        s->q[j] = choose(where, next.q[j], s->q[j]);
        s->p[j] = choose(where, next.p[j], s->p[j]);
    }
    s->cosine = choose(where, next.cosine, s->cosine);
    s->sine = choose(where, next.sine, s->sine);
}

/* Go on to this number of shortest cells after the start: by cells of the round's length, then by shorter ones. */
LANES_INLINE void go_to_cell(const vi_lane_group *g, int at, int modes, vector cell, sampled_flight *f)
{
    const vi_many_modes *many = &g->many;
    const vector level = load(many->level + at), last = load(many->last + at);
    vector left = cell - f->passed;
    for (int l = 0; l < VI_LEVELS; ++l) {
        const vi_level_rows *rows = &many->rows[l];
        const vector cells = load(rows->cells + at);
        const mask has = (level <= (double)l) & (last >= (double)l);
        for (int i = 0; i < VI_CELLS; ++i) {
            const mask goes = has & (left >= cells);
            if (!any(goes)) {
                break;
            }
            step_some(at, modes, rows->step, rows->turn_cosine, rows->turn_sine, goes, &f->state);
            left -= only(goes, cells);
        }
    }
    const mask half = left >= 1.0;
    if (any(half)) {
        step_some(at, modes, many->half, many->half_cosine, many->half_sine, half, &f->state);
    }
    f->passed = cell;
}

LANES_INLINE void expand_sampled(const vi_lane_group *g, int at, int modes, const modal_state *s, sampled_motion *m)
{
    derivatives d;
    expand_modes(g, at, modes, s, &d);
    for (int k = 0; k < m->count; ++k) {
        (void)expand_point(g, at, modes, m->point[k], g->many.rest_place, s, &d, m->term[k]);
    }
}

/* Write the samples of some lanes at a share of their cells. A contact is at its stop where rounding has it beyond. */
LANES_INLINE void write_samples(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int at, mask where,
                                const sampled_motion *m, vector share)
{
    const vector rate = load(g->cell_rate + at);
    vector x[VI_POINTS], v[VI_POINTS];
    for (int k = 0; k < m->count; ++k) {
        const motion_at motion = motion_by(m->term[k], VI_LANE_ORDER, share);
        x[k] = m->term[k][0] + motion.added;
        v[k] = motion.slope * rate;
    }
    for (int i = 0; i < VI_WIDTH; ++i) {
        double displacement[VI_POINTS], velocity[VI_POINTS];
        if (!where[i]) {
            continue;
        }
        for (int k = 0; k < m->count; ++k) {
            displacement[k] = x[k][i];
            velocity[k] = v[k][i];
            if (m->point[k] < VI_LANES_CONTACTS) {
                const int64_t contact = m->point[k] * points->count + (int64_t)g->record.point[at + i];
                const double direction = points->direction[contact], stop = direction * points->position[contact];
                displacement[k] = direction * (displacement[k] < stop ? displacement[k] : stop);
                velocity[k] *= direction;
            }
        }
        vi_lane_write_sample(g, plan, points, at + i, displacement, velocity);
    }
}

/* Keep the instants at the start of a round: its samples are taken from there on. */
LANES_INLINE void sample_instants_from(vi_lane_group *g, int at)
{
    store(g->samples.from_periods + at, load(g->periods + at));
    store(g->samples.from_rest + at, load(g->rest + at));
    store(g->samples.from_rest_low + at, load(g->rest_low + at));
}

/* Take the samples since the start of the round, after the clocks have moved. */
LANES_INLINE void take_samples_of_many(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int at)
{
    const int modes = vi_real_modes(plan);
    const sampled_round round = sampled_round_of(g, at);
    sampled_motion motion;
    sampled_flight f = {.passed = all(0.0)};
    vector offset;
    mask due = next_in_round(g, at, &round, &offset);
    motion.count = vi_lane_sampled(plan, motion.point);
    f.state.cosine = load(g->start_cosine + at);
    f.state.sine = load(g->start_sine + at);
    for (int j = 0; j < modes; ++j) {
        f.state.q[j] = load(g->start_q[j] + at);
        f.state.p[j] = load(g->start_p[j] + at);
    }
    for (bool first = true; any(due); first = false) { /* each pass takes a sample of each lane that is due */
        const vector cells = larger(smaller(offset, round.length), all(0.0)) * load(g->cell_rate + at);
        const vector whole = choose(due, whole_part(cells), f.passed);
        if (first || any(whole > f.passed)) {
            go_to_cell(g, at, modes, whole, &f);
            expand_sampled(g, at, modes, &f.state, &motion);
        }
        write_samples(g, plan, points, at, due, &motion, cells - whole);
        due = next_in_round(g, at, &round, &offset);
    }
}
