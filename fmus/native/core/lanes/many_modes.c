/* The motion of one lane of a body of several modes. */
#include <float.h>
#include <math.h>

#include "body/landing.h"
#include "lanes/lane_body.h"
#include "lanes/lane_sines.h"
#include "lanes/lane_turn.h"
#include "lanes/many_sampling.h"
#include "lanes/many_tables.h"
#include "motion/majorant.h"

/* ---- the state ---- */

/* A state of a lane: the unforced motion of its modes, and the phase of the force. */
typedef struct {
    double q[VI_REAL_MODES], p[VI_REAL_MODES], cosine, sine;
} place;

static place start_of(const vi_lane_group *g, int lane, int modes)
{
    place s = {.cosine = g->start_cosine[lane], .sine = g->start_sine[lane]};
    for (int j = 0; j < modes; ++j) {
        s.q[j] = g->start_q[j][lane];
        s.p[j] = g->start_p[j][lane];
    }
    return s;
}

/* The state after a step of these tables, a cell of a level or a shortest cell. */
static place after_step(int lane, int modes, const vi_lane_array step[][4], double turn_cosine, double turn_sine,
                        const place *s)
{
    place next = {.cosine = s->cosine * turn_cosine - s->sine * turn_sine,
                  .sine = s->sine * turn_cosine + s->cosine * turn_sine};
    for (int j = 0; j < modes; ++j) {
        next.q[j] = step[j][0][lane] * s->q[j] + step[j][1][lane] * s->p[j];
        next.p[j] = step[j][2][lane] * s->q[j] + step[j][3][lane] * s->p[j];
    }
    return next;
}

static place next_of(const vi_lane_group *g, int lane, int modes, int level, const place *s)
{
    const vi_level_rows *of = &g->many.rows[level];
    return after_step(lane, modes, of->step, of->turn_cosine[lane], of->turn_sine[lane], s);
}

static place shortest_later(const vi_lane_group *g, int lane, int modes, const place *s)
{
    const vi_many_modes *many = &g->many;
    return after_step(lane, modes, many->half, many->half_cosine[lane], many->half_sine[lane], s);
}

/* Displacement and velocity of a point. */
static double point_at(const vi_lane_group *g, int lane, int modes, int point, const place *s, double *velocity)
{
    const vi_many_modes *many = &g->many;
    const double c = many->cosine[point][lane], n = many->sine[point][lane];
    double x = (c * s->cosine + n * s->sine) + many->offset[point][lane];
    double v = g->angular_frequency[lane] * (n * s->cosine - c * s->sine);
    for (int j = 0; j < modes; ++j) {
        x += many->shape[point][j][lane] * s->q[j];
        v += many->shape[point][j][lane] * s->p[j];
    }
    *velocity = v;
    return x;
}

static double amplitude_of(const vi_lane_group *g, int lane, int j, double q, double p)
{
    return fabs(q) + fabs(p + g->many.mix[j][lane] * q) * g->many.reach[j][lane];
}

/* ---- the motion over a shortest cell ---- */

/* Taylor terms of all modes. */
typedef struct {
    vi_lane_cell mode[VI_REAL_MODES];
} motion;

static motion motion_from(const vi_lane_group *g, int lane, int modes, const place *s)
{
    motion m;
    for (int j = 0; j < modes; ++j) {
        const double drag = g->many.drag[j][lane], spring = g->many.spring[j][lane];
        double *term = m.mode[j].term;
        m.mode[j].order = VI_LANE_ORDER;
        term[0] = s->q[j];
        term[1] = s->p[j] * g->cell[lane];
        for (int n = 0; n + 2 <= VI_LANE_ORDER; ++n) {
            term[n + 2] = -(drag * (n + 1.0) * term[n + 1] + spring * term[n]) / ((n + 1.0) * (n + 2.0));
        }
    }
    return m;
}

static vi_lane_cell point_motion(const vi_lane_group *g, int lane, int modes, int point, const motion *m,
                                 const place *s)
{
    const vi_many_modes *many = &g->many;
    const double c = many->cosine[point][lane], n = many->sine[point][lane];
    const double turn = many->turn[lane], square = turn * turn;
    double drive[2] = {c * s->cosine + n * s->sine, turn * (n * s->cosine - c * s->sine)};
    vi_lane_cell cell = {.order = VI_LANE_ORDER};
    for (int i = 0; i <= VI_LANE_ORDER; ++i) {
        cell.term[i] = drive[0] + (i == 0 ? many->offset[point][lane] : 0.0);
        const double next = -drive[0] * square / ((i + 1.0) * (i + 2.0));
        drive[0] = drive[1];
        drive[1] = next;
        for (int j = 0; j < modes; ++j) {
            cell.term[i] += many->shape[point][j][lane] * m->mode[j].term[i];
        }
    }
    return cell;
}

/* ---- the careful search ---- */

/* Set the modes of the further sines by the clock. */
static void set_sines(vi_lane_group *g, int lane, int modes)
{
    const int further = vi_further_sines(g);
    if (further > 0) {
        vi_lane_set_sines(g, lane, modes - 2 * further);
    }
}

static vi_cell_result search(vi_lane_group *g, int lane, int modes, int contacts, double *share, vi_lane_meeting *met)
{
    set_sines(g, lane, modes);
    for (int j = 0; j < modes; ++j) {
        g->start_q[j][lane] = g->q[j][lane];
        g->start_p[j][lane] = g->p[j][lane];
    }
    vi_lane_turn(g->angular_frequency[lane] * g->rest[lane], &g->start_cosine[lane], &g->start_sine[lane]);
    g->passed[lane] = 0.0;
    g->many.start_level[lane] = g->many.last[lane];
    const place now = start_of(g, lane, modes);
    const motion m = motion_from(g, lane, modes, &now);
    vi_cell_result result = VI_CELL_CLEAR;
    for (int c = 0; c < contacts; ++c) {
        vi_lane_cell cell = point_motion(g, lane, modes, c, &m, &now);
        double scale = g->many.size[c][lane], slope;
        for (int j = 0; j < modes; ++j) {
            scale += fabs(g->many.shape[c][j][lane] * now.q[j]);
        }
        if (g->on[lane] == c + 1) {
            cell.term[0] = 0.0;
        }
        const double before = *share;
        const vi_cell_result one = vi_lane_cell_search(&cell, scale, share, &slope);
        if (one == VI_CELL_UNDECIDED || (one == VI_CELL_HIT && result == VI_CELL_HIT && *share == before)) {
            return VI_CELL_UNDECIDED; /* two contacts at one instant */
        }
        if (one == VI_CELL_HIT) {
            *met = (vi_lane_meeting){c, slope * g->cell_rate[lane]};
            result = one;
        }
    }
    for (int j = 0; j < modes; ++j) {
        double slope;
        vi_lane_cell_at(&m.mode[j], *share, &g->q[j][lane], &slope);
        g->p[j][lane] = slope * g->cell_rate[lane];
    }
    g->share[lane] = *share;
    g->many.level[lane] = g->many.last[lane];
    return result;
}

static bool rebound(vi_lane_group *g, int lane, int modes, const vi_lane_meeting *met, double after)
{
    const vi_many_modes *many = &g->many;
    const int c = met->contact;
    double size = many->size[c][lane], bend = many->steady_pull[c][lane];
    for (int j = 0; j < modes; ++j) {
        const double reach = fabs(many->shape[c][j][lane]) * amplitude_of(g, lane, j, g->q[j][lane], g->p[j][lane]);
        size += reach;
        bend += reach * many->pull[j][lane];
        g->q[j][lane] -= many->shift[c][j][lane] * (met->approach + after);
        g->p[j][lane] -= many->kick[c][j][lane] * (met->approach + after);
    }
    return met->approach * met->approach > 2.0 * bend * DBL_EPSILON * size;
}

/* ---- extremes ---- */

/* Largest deviations of the observed point and of its velocity from a line over a cell of a level. */
typedef struct {
    double place, velocity;
} bulges;

static bulges bulges_of(const vi_lane_group *g, int lane, int modes, int level, const place *s)
{
    const vi_lane_array *sag = g->many.sag[level], *tilt = g->many.tilt[level];
    bulges b = {sag[VI_REAL_MODES][lane], tilt[VI_REAL_MODES][lane]};
    for (int j = 0; j < modes; ++j) {
        const double amplitude = amplitude_of(g, lane, j, s->q[j], s->p[j]);
        b.place += sag[j][lane] * amplitude;
        b.velocity += tilt[j][lane] * amplitude;
    }
    return b;
}

/* Largest sign * displacement of the observed point over a share of a shortest cell. */
static double crest(const vi_lane_group *g, int lane, int modes, double sign, double share, const place *s)
{
    const motion m = motion_from(g, lane, modes, s);
    const vi_lane_cell cell = point_motion(g, lane, modes, VI_LANES_CONTACTS, &m, s);
    double slope, end;
    vi_lane_cell_at(&cell, share, &end, &slope);
    return vi_max(sign * end, vi_lane_cell_crest(&cell, sign, share));
}

/* The same over the two shortest cells of a cell. */
static double crest_of_two(const vi_lane_group *g, int lane, int modes, double sign, const place *s)
{
    const place half = shortest_later(g, lane, modes, s);
    return vi_max(crest(g, lane, modes, sign, 1.0, s), crest(g, lane, modes, sign, 1.0, &half));
}

/* Largest sign * displacement over whole cells of a level; a cell whose crest may be the largest is divided. */
static double extend(const vi_lane_group *g, int lane, int modes, double sign, int level, int cells, place s,
                     double most)
{
    const int last = (int)g->many.last[lane];
    const bulges b = bulges_of(g, lane, modes, level, &s);
    double v, end_v, x = point_at(g, lane, modes, VI_LANES_CONTACTS, &s, &v);
    for (int i = 0; i < cells; ++i) {
        const place next = next_of(g, lane, modes, level, &s);
        const double end = point_at(g, lane, modes, VI_LANES_CONTACTS, &next, &end_v);
        most = vi_max(most, vi_max(sign * x, sign * end));
        const bool monotone = vi_min(v, end_v) > b.velocity || vi_max(v, end_v) < -b.velocity;
        if (!monotone && vi_max(sign * x, sign * end) + b.place > most) {
            most = level < last ? extend(g, lane, modes, sign, level + 1, VI_LEVEL_RATIO, s, most)
                                : vi_max(most, crest_of_two(g, lane, modes, sign, &s));
        }
        s = next;
        x = end;
        v = end_v;
    }
    return most;
}

static void extremes(vi_lane_group *g, int lane, int modes, int contacts)
{
    (void)contacts;
    double *highest = &g->record.most[lane], *lowest = &g->record.least[lane];
    const int level = (int)g->many.start_level[lane], cells = (int)g->passed[lane];
    place s = start_of(g, lane, modes);
    *highest = extend(g, lane, modes, 1.0, level, cells, s, *highest);
    *lowest = -extend(g, lane, modes, -1.0, level, cells, s, -*lowest);
    double share = g->share[lane];
    if (share > 0.0) {
        for (int i = 0; i < cells; ++i) {
            s = next_of(g, lane, modes, level, &s);
        }
    }
    for (; share > 0.0; share -= 1.0) { /* a search has passed up to two shortest cells */
        const double part = vi_min(share, 1.0);
        *highest = vi_max(*highest, crest(g, lane, modes, 1.0, part, &s));
        *lowest = vi_min(*lowest, -crest(g, lane, modes, -1.0, part, &s));
        s = shortest_later(g, lane, modes, &s);
    }
}

static place now_of(const vi_lane_group *g, int lane, int modes)
{
    place s;
    vi_lane_turn(g->angular_frequency[lane] * g->rest[lane], &s.cosine, &s.sine);
    for (int j = 0; j < modes; ++j) {
        s.q[j] = g->q[j][lane];
        s.p[j] = g->p[j][lane];
    }
    return s;
}

static void observe(vi_lane_group *g, int lane, int modes, int contacts, double *displacement, double *velocity)
{
    (void)contacts;
    set_sines(g, lane, modes);
    const place s = now_of(g, lane, modes);
    *displacement = point_at(g, lane, modes, VI_LANES_CONTACTS, &s, velocity);
}

static void state(const vi_lane_group *g, int lane, const vi_lanes_plan *plan, double q[], double p[])
{
    const vi_many_modes *many = &g->many;
    const int modes = vi_own_modes(plan);
    const vi_lane_phases phases = vi_lane_phases_at(g, lane, g->periods[lane], g->rest[lane]);
    place s = now_of(g, lane, modes);
    for (int j = 0; j < modes; ++j) {
        const double c = many->steady_cosine[j][lane], n = many->steady_sine[j][lane];
        s.q[j] += (c * s.cosine + n * s.sine) + many->rest[j][lane];
        s.p[j] += g->angular_frequency[lane] * (n * s.cosine - c * s.sine);
        for (int k = 0; k < plan->further; ++k) {
            const double its_c = g->sines->steady[k][j][VI_OF_ITS_COSINE][lane];
            const double its_n = g->sines->steady[k][j][VI_OF_ITS_SINE][lane];
            const double cosine = phases.of[k][VI_OF_ITS_COSINE], sine = phases.of[k][VI_OF_ITS_SINE];
            s.q[j] += its_c * cosine + its_n * sine;
            s.p[j] += g->sines->angular_frequency[k][lane] * (its_n * cosine - its_c * sine);
        }
    }
    for (int i = 0; i < plan->modes; ++i) {
        q[i] = plan->coupled ? 0.0 : s.q[i];
        p[i] = plan->coupled ? 0.0 : s.p[i];
        for (int j = 0; j < modes && plan->coupled; ++j) {
            q[i] += many->to_state[i][j][lane] * s.q[j];
            p[i] += many->to_state[i][j][lane] * s.p[j];
        }
    }
}

const vi_lane_body vi_lane_many_modes = {
    vi_lane_take_many, search, rebound, extremes, observe, state, vi_lane_sample_many_from, vi_lane_take_samples_of_many};
