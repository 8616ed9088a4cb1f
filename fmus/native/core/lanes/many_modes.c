/* A body of several modes: its tables, and the motion of one lane of it. */
#include <float.h>
#include <math.h>

#include "body/landing.h"
#include "lanes/lane_body.h"
#include "lanes/lane_turn.h"
#include "motion/flow.h"
#include "motion/majorant.h"

/* Largest steady response, in units of the force's effect within one radian; a larger one costs as many roundings. */
static const double LARGEST_STEADY = 1000.0;
/* Ratio of the cell lengths of two levels. */
static const double RATIO = 4.0;
/* Least rate of an underdamped mode, relative to its natural frequency, for bounds by amplitude; below, by energy. */
static const double LEAST_TURNING = 0.1;

/* ---- the state ---- */

/* A state of a lane: the unforced motion of its modes, and the phase of the force. */
typedef struct {
    double q[VI_LANES_MODES], p[VI_LANES_MODES], cosine, sine;
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

/* The state one cell of a level later. */
static place next_of(const vi_lane_group *g, int lane, int modes, int level, const place *s)
{
    const vi_many_modes *many = &g->many;
    const double c = many->turn_cosine[level][lane], n = many->turn_sine[level][lane];
    place next = {.cosine = s->cosine * c - s->sine * n, .sine = s->sine * c + s->cosine * n};
    for (int j = 0; j < modes; ++j) {
        const vi_lane_array *step = many->step[level][j];
        next.q[j] = step[0][lane] * s->q[j] + step[1][lane] * s->p[j];
        next.p[j] = step[2][lane] * s->q[j] + step[3][lane] * s->p[j];
    }
    return next;
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
    vi_lane_cell mode[VI_LANES_MODES];
} motion;

static motion motion_from(const vi_lane_group *g, int lane, int modes, const place *s)
{
    const double cell = g->cell[lane];
    motion m;
    for (int j = 0; j < modes; ++j) {
        const double drag = 2.0 * g->many.decay[j][lane] * cell, spring = g->many.stiffness[j][lane] * (cell * cell);
        double *term = m.mode[j].term;
        term[0] = s->q[j];
        term[1] = s->p[j] * cell;
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
    const double turn = g->angular_frequency[lane] * g->cell[lane], square = turn * turn;
    double drive[2] = {c * s->cosine + n * s->sine, turn * (n * s->cosine - c * s->sine)};
    vi_lane_cell cell;
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

static vi_cell_result search(vi_lane_group *g, int lane, int modes, int contacts, double *share, vi_lane_meeting *met)
{
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
    const double w = g->angular_frequency[lane];
    double size = many->size[c][lane], bend = w * w * (fabs(many->cosine[c][lane]) + fabs(many->sine[c][lane]));
    for (int j = 0; j < modes; ++j) {
        const double reach = fabs(many->shape[c][j][lane]) * amplitude_of(g, lane, j, g->q[j][lane], g->p[j][lane]);
        const double natural = sqrt(many->stiffness[j][lane]);
        size += reach;
        bend += reach * (natural + 2.0 * many->decay[j][lane]) * natural;
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
    const vi_lane_array *bulge = g->many.bulge[level][VI_LANES_CONTACTS], *tilt = g->many.tilt[level];
    bulges b = {bulge[VI_LANES_MODES][lane], tilt[VI_LANES_MODES][lane]};
    for (int j = 0; j < modes; ++j) {
        const double amplitude = amplitude_of(g, lane, j, s->q[j], s->p[j]);
        b.place += bulge[j][lane] * amplitude;
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
            most = level < last ? extend(g, lane, modes, sign, level + 1, (int)RATIO, s, most)
                                : vi_max(most, crest(g, lane, modes, sign, 1.0, &s));
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
    if (g->share[lane] > 0.0) { /* only after a careful search, which begins at the lane's state */
        *highest = vi_max(*highest, crest(g, lane, modes, 1.0, g->share[lane], &s));
        *lowest = vi_min(*lowest, -crest(g, lane, modes, -1.0, g->share[lane], &s));
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
    const place s = now_of(g, lane, modes);
    *displacement = point_at(g, lane, modes, VI_LANES_CONTACTS, &s, velocity);
}

static void state(const vi_lane_group *g, int lane, int modes, double q[], double p[])
{
    const vi_many_modes *many = &g->many;
    const place s = now_of(g, lane, modes);
    for (int j = 0; j < modes; ++j) {
        const double c = many->steady_cosine[j][lane], n = many->steady_sine[j][lane];
        q[j] = s.q[j] + ((c * s.cosine + n * s.sine) + many->rest[j][lane]);
        p[j] = s.p[j] + g->angular_frequency[lane] * (n * s.cosine - c * s.sine);
    }
}

/* ---- the start ---- */

/* Bounds of a mode's second and third derivatives per unit of its amplitude. */
typedef struct {
    double second, third;
} bounds;

static bounds take_amplitude(vi_lane_group *g, int lane, int j, const vi_mode *mode)
{
    vi_many_modes *many = &g->many;
    const double natural = mode->natural, drag = 2.0 * mode->decay;
    if (mode->regime == VI_UNDERDAMPED && mode->rate > LEAST_TURNING * natural) {
        many->mix[j][lane] = mode->decay;
        many->reach[j][lane] = 1.0 / mode->rate;
        return (bounds){mode->stiffness, mode->stiffness * natural};
    }
    many->mix[j][lane] = 0.0;
    many->reach[j][lane] = 1.0 / natural;
    const double second = (drag + natural) * natural;
    return (bounds){second, drag * second + mode->stiffness * natural};
}

/* Set a mode and its response to the force; false where lockstep cannot follow it. */
static bool take_mode(vi_lane_group *g, int lane, int j, const vi_mode *mode, double held, double q, double p)
{
    vi_many_modes *many = &g->many;
    const double c = mode->steady_cos, n = mode->steady_sin, w = mode->angular_frequency;
    if ((mode->force != 0.0 && !mode->steady_exists)
        || mode->steady_amplitude * mode->fastest * mode->fastest > LARGEST_STEADY * fabs(mode->force)) {
        return false;
    }
    double cosine, sine;
    vi_lane_turn(w * g->rest[lane], &cosine, &sine);
    many->stiffness[j][lane] = mode->stiffness;
    many->decay[j][lane] = mode->decay;
    many->steady_cosine[j][lane] = c;
    many->steady_sine[j][lane] = n;
    many->rest[j][lane] = held / mode->stiffness;
    g->q[j][lane] = q - ((c * cosine + n * sine) + many->rest[j][lane]);
    g->p[j][lane] = p - w * (n * cosine - c * sine);
    return isfinite(g->q[j][lane]) && isfinite(g->p[j][lane]);
}

/* Set the lengths of the cells: the longest is a part of a period, the shortest short against every rate. */
static bool take_levels(vi_lane_group *g, int lane, double fastest)
{
    vi_many_modes *many = &g->many;
    const double period = g->period[lane];
    const double cell = vi_lane_cell_length(vi_min(VI_CELL_REACH / fastest, VI_LONGEST_CELL * period));
    if (!(cell > 0.0) || !(period <= VI_MOST_CELLS * cell)) {
        return false;
    }
    int last = 0;
    for (double longer = RATIO * cell; last < VI_LEVELS - 1 && longer <= VI_LONGEST_CELL * period; longer *= RATIO) {
        last += 1;
    }
    g->cell[lane] = cell;
    g->cell_rate[lane] = 1.0 / cell;
    many->last[lane] = many->level[lane] = many->start_level[lane] = last;
    double cells = 1.0;
    for (int level = last; level >= 0; --level) {
        many->cells[level][lane] = cells;
        many->rate[level][lane] = 1.0 / (cells * cell);
        cells *= RATIO;
    }
    return true;
}

/* Set a point of the body: its displacement from its stop, positive towards the stop. */
static void take_point(vi_lane_group *g, int lane, int point, int modes, double direction, double position,
                       const double shape[])
{
    vi_many_modes *many = &g->many;
    many->cosine[point][lane] = many->sine[point][lane] = 0.0;
    many->offset[point][lane] = -direction * position;
    for (int j = 0; j < modes; ++j) {
        const double s = direction * shape[j];
        many->shape[point][j][lane] = s;
        many->cosine[point][lane] += s * many->steady_cosine[j][lane];
        many->sine[point][lane] += s * many->steady_sine[j][lane];
        many->offset[point][lane] += s * many->rest[j][lane];
    }
}

/* Size of the steady response of a point. */
static double steady_size(const vi_lane_group *g, int lane, int point)
{
    return fabs(g->many.cosine[point][lane]) + fabs(g->many.sine[point][lane]);
}

/* Set the largest deviations of a point from a line over cells of all levels. */
static void take_bulges(vi_lane_group *g, int lane, int point, int modes, const bounds bound[])
{
    vi_many_modes *many = &g->many;
    const double w = g->angular_frequency[lane], steady = steady_size(g, lane, point);
    for (int level = 0; level <= (int)many->last[lane]; ++level) {
        const double length = many->cells[level][lane] * g->cell[lane], eighth = 0.125 * length * length;
        vi_lane_array *bulge = many->bulge[level][point];
        for (int j = 0; j < modes; ++j) {
            bulge[j][lane] = fabs(many->shape[point][j][lane]) * vi_min(bound[j].second * eighth, 2.0);
        }
        bulge[VI_LANES_MODES][lane] = steady * vi_min(w * w * eighth, 2.0);
    }
}

/* Set the same deviations of the observed velocity. */
static void take_tilts(vi_lane_group *g, int lane, int modes, const bounds bound[])
{
    vi_many_modes *many = &g->many;
    const int point = VI_LANES_CONTACTS;
    const double w = g->angular_frequency[lane], steady = w * steady_size(g, lane, point);
    for (int level = 0; level <= (int)many->last[lane]; ++level) {
        const double length = many->cells[level][lane] * g->cell[lane], eighth = 0.125 * length * length;
        vi_lane_array *tilt = many->tilt[level];
        for (int j = 0; j < modes; ++j) {
            const double natural = sqrt(many->stiffness[j][lane]);
            tilt[j][lane] = fabs(many->shape[point][j][lane]) * vi_min(bound[j].third * eighth, 2.0 * natural);
        }
        tilt[VI_LANES_MODES][lane] = steady * vi_min(w * w * eighth, 2.0);
    }
}

/* Set bounds on the return of a contact just left within a shortest cell. */
static void take_leaving(vi_lane_group *g, int lane, int c, int modes, const bounds bound[])
{
    vi_many_modes *many = &g->many;
    const double w = g->angular_frequency[lane], cube = g->cell[lane] * g->cell[lane] * g->cell[lane] / 24.0;
    for (int j = 0; j < modes; ++j) {
        many->leaving[c][j][lane] = fabs(many->shape[c][j][lane]) * bound[j].third * cube;
    }
    many->leaving[c][VI_LANES_MODES][lane] = steady_size(g, lane, c) * w * w * w * cube;
}

/* Set a contact of a point; false where it is invalid, or the start is not clear of it. */
static bool take_contact(vi_lane_group *g, int lane, int c, int modes, const vi_lanes_points *points, int64_t point,
                         const double q[])
{
    const int64_t i = c * points->count + point;
    double shape[VI_LANES_MODES], mobility = 0.0, start = 0.0, size = fabs(points->position[i]);
    for (int j = 0; j < modes; ++j) {
        const int64_t at = (c * modes + j) * points->count + point;
        shape[j] = points->shape[at];
        mobility += shape[j] * points->impulse[at];
        start += shape[j] * q[j];
        size += fabs(shape[j]) * (fabs(q[j]) + fabs(g->many.rest[j][lane]));
    }
    const double clearance = points->direction[i] * (points->position[i] - start);
    if (!vi_lane_is_contact(points, i) || !(mobility > 0.0) || !isfinite(mobility)
        || !(clearance > VI_ROUNDING * size)) {
        return false;
    }
    take_point(g, lane, c, modes, points->direction[i], points->position[i], shape);
    for (int j = 0; j < modes; ++j) {
        const double impulse = points->impulse[(c * modes + j) * points->count + point];
        g->many.kick[c][j][lane] = points->direction[i] * impulse / mobility;
    }
    g->many.size[c][lane] = fabs(points->position[i]) + fabs(g->many.offset[c][lane]) + fabs(g->many.cosine[c][lane])
                            + fabs(g->many.sine[c][lane]);
    g->restitution[c][lane] = points->restitution[i];
    g->yield_velocity[c][lane] = points->yield_velocity[i];
    return isfinite(g->many.size[c][lane]);
}

/* Propagator of an unforced mode, as `vi_mode_propagator`. */
static void propagate(const vi_mode *mode, double u, double phi[4])
{
    vi_mode_functions f = {0};
    double unused;
    f.slow = vi_lane_decay(mode->slow * u, &unused);
    if (mode->regime == VI_OVERDAMPED) {
        f.fast = vi_lane_decay(mode->fast * u, &unused);
        (void)vi_lane_decay(2.0 * mode->rate * u, &f.lost);
    } else {
        vi_lane_turn(mode->rate * u, &f.cosine, &f.sine);
    }
    vi_mode_propagator_by(mode, u, &f, phi);
}

static void take_steps(vi_lane_group *g, int lane, int modes, const vi_mode mode[])
{
    vi_many_modes *many = &g->many;
    for (int level = 0; level <= (int)many->last[lane]; ++level) {
        const double length = many->cells[level][lane] * g->cell[lane];
        for (int j = 0; j < modes; ++j) {
            double phi[4];
            propagate(&mode[j], length, phi);
            for (int i = 0; i < 4; ++i) {
                many->step[level][j][i][lane] = phi[i];
            }
        }
        vi_lane_turn(g->angular_frequency[lane] * length, &many->turn_cosine[level][lane],
                     &many->turn_sine[level][lane]);
    }
}

static bool take(vi_lane_group *g, int lane, const vi_lanes_plan *plan, const vi_lanes_points *points, int64_t point,
                 const double q[], const double p[])
{
    const int modes = plan->modes;
    vi_mode mode[VI_LANES_MODES];
    bounds bound[VI_LANES_MODES];
    double fastest = 0.0, observed[VI_LANES_MODES];
    for (int j = 0; j < modes; ++j) {
        const int64_t i = j * points->count + point;
        const double held = points->held[i], w = points->angular_frequency[point];
        vi_mode_start(&mode[j], 1.0, 2.0 * points->decay[i], points->stiffness[i], points->force[i], w);
        if (!isfinite(points->force[i]) || !isfinite(held) || !take_mode(g, lane, j, &mode[j], held, q[j], p[j])) {
            return false;
        }
        bound[j] = take_amplitude(g, lane, j, &mode[j]);
        fastest = vi_max(fastest, mode[j].fastest);
        observed[j] = points->observed[i];
    }
    if (!take_levels(g, lane, fastest)) {
        return false;
    }
    take_steps(g, lane, modes, mode);
    for (int c = 0; c < plan->contacts; ++c) {
        if (!take_contact(g, lane, c, modes, points, point, q)) {
            return false;
        }
        take_bulges(g, lane, c, modes, bound);
        take_leaving(g, lane, c, modes, bound);
    }
    take_point(g, lane, VI_LANES_CONTACTS, modes, 1.0, 0.0, observed);
    take_bulges(g, lane, VI_LANES_CONTACTS, modes, bound);
    take_tilts(g, lane, modes, bound);
    return true;
}

const vi_lane_body vi_lane_many_modes = {take, search, rebound, extremes, observe, state};
