/* The tables of a body of several modes in a lane. */
#include "lanes/many_tables.h"

#include <math.h>

#include "body/landing.h"
#include "lanes/lane_body.h"
#include "lanes/lane_turn.h"
#include "lanes/many_coupling.h"
#include "lanes/many_loads.h"
#include "motion/flow.h"
#include "motion/majorant.h"

/* Longest length of a shortest cell, in units of 1 / fastest rate; the omitted Taylor terms are below 3e-17. */
static const double REACH = 0.5;
/* Longest cell, in periods; a round of such cells takes less than three periods. */
static const double LONGEST_CELL = 0.25;
/* Length over which the displacement of a mode without a spring is bounded, in periods: a round, and one cell more. */
static const double LONGEST_ROUND = 4.0;
/* Least rate of an underdamped mode, relative to its natural frequency, for bounds by amplitude; below, by energy. */
static const double LEAST_TURNING = 0.1;

/* Bounds of a mode's derivatives per unit of its amplitude. */
typedef struct {
    double first, second, third, fourth;
} bounds;

static bounds take_amplitude(vi_lane_group *g, int lane, int j, const vi_mode *mode)
{
    vi_many_modes *many = &g->many;
    const double natural = mode->natural, drag = 2.0 * mode->decay;
    if (mode->regime == VI_UNDERDAMPED && mode->rate > LEAST_TURNING * natural) {
        many->mix[j][lane] = mode->decay;
        many->reach[j][lane] = 1.0 / mode->rate;
        const double square = mode->stiffness;
        return (bounds){natural, square, square * natural, square * square};
    }
    many->mix[j][lane] = 0.0;
    if (!(mode->stiffness > 0.0)) { /* the speed never grows */
        const double length = LONGEST_ROUND * g->period[lane], speed = 1.0 / length, second = drag * speed;
        many->reach[j][lane] = length;
        return (bounds){speed, second, drag * second, drag * drag * second};
    }
    many->reach[j][lane] = 1.0 / natural;
    const double second = (drag + natural) * natural;
    const double third = drag * second + mode->stiffness * natural;
    return (bounds){natural, second, third, drag * third + mode->stiffness * second};
}

/* Set the lengths of the cells: the longest is a part of a period, the shortest short against every rate. */
static bool take_levels(vi_lane_group *g, int lane, double fastest)
{
    vi_many_modes *many = &g->many;
    const double period = g->period[lane], longest = LONGEST_CELL * period;
    const double cell = vi_lane_cell_length(vi_min(REACH / fastest, 0.5 * longest));
    if (!(cell > 0.0) || !(period <= VI_MOST_CELLS * cell)) {
        return false;
    }
    int last = 0;
    for (double longer = 2.0 * (double)VI_LEVEL_RATIO * cell; last < VI_LEVELS - 1 && longer <= longest;
         longer *= (double)VI_LEVEL_RATIO) {
        last += 1;
    }
    g->cell[lane] = cell;
    g->cell_rate[lane] = 1.0 / cell;
    many->turn[lane] = g->angular_frequency[lane] * cell;
    many->last[lane] = many->level[lane] = many->start_level[lane] = last;
    double cells = 2.0;
    for (int level = last; level >= 0; --level) {
        many->rows[level].cells[lane] = cells;
        many->rows[level].rate[lane] = 1.0 / (cells * cell);
        cells *= (double)VI_LEVEL_RATIO;
    }
    return true;
}

/* Set a point of the body: its displacement from its stop, positive towards the stop. */
static void take_point(vi_lane_group *g, int lane, int point, int modes, double direction, double position,
                       const double shape[])
{
    vi_many_modes *many = &g->many;
    many->cosine[point][lane] = many->sine[point][lane] = 0.0;
    many->rest_place[point][lane] = 0.0;
    many->offset[point][lane] = -direction * position;
    for (int j = 0; j < modes; ++j) {
        const double s = direction * shape[j];
        many->shape[point][j][lane] = s;
        many->cosine[point][lane] += s * many->steady_cosine[j][lane];
        many->sine[point][lane] += s * many->steady_sine[j][lane];
        many->rest_place[point][lane] += s * many->rest[j][lane];
        many->offset[point][lane] += s * many->rest[j][lane];
    }
}

/* Size of the steady response of a point. */
static double steady_size(const vi_lane_group *g, int lane, int point)
{
    return fabs(g->many.cosine[point][lane]) + fabs(g->many.sine[point][lane]);
}

/* Largest deviation from a cubic through both ends of a cell, of unit amplitude with these rates. A cubic of a long cell
 * is not closer than both of them are to zero. */
static double bulge_of(double first, double fourth, double length)
{
    const double square = length * length;
    return vi_min(fourth * (square * square) / 384.0, 2.0 + 0.25 * first * length);
}

/* Set the largest deviations of a contact from a cubic over cells of all levels. */
static void take_bulges(vi_lane_group *g, int lane, int c, int modes, const bounds bound[])
{
    vi_many_modes *many = &g->many;
    const double w = g->angular_frequency[lane], steady = steady_size(g, lane, c), noise = 4.0 * VI_ROUNDING;
    for (int level = 0; level <= (int)many->last[lane]; ++level) {
        const double length = many->rows[level].cells[lane] * g->cell[lane];
        vi_lane_array *bulge = many->rows[level].bulge[c];
        for (int j = 0; j < modes; ++j) {
            bulge[j][lane] = fabs(many->shape[c][j][lane])
                             * (bulge_of(bound[j].first, bound[j].fourth, length) + noise);
        }
        bulge[modes][lane] = steady * bulge_of(w, w * w * w * w, length) + noise * many->size[c][lane];
    }
    many->steady_pull[c][lane] = w * w * steady;
}

/* Set the largest deviations of the observed displacement from a cubic. */
static void take_waves(vi_lane_group *g, int lane, int modes, const bounds bound[])
{
    vi_many_modes *many = &g->many;
    const double cell = g->cell[lane], square = cell * cell, w = g->angular_frequency[lane];
    for (int j = 0; j <= modes; ++j) {
        const double first = j < modes ? bound[j].first : w, fourth = j < modes ? bound[j].fourth : w * w * w * w;
        const double size = j < modes ? fabs(many->shape[VI_LANES_CONTACTS][j][lane])
                                      : steady_size(g, lane, VI_LANES_CONTACTS);
        many->wave[j][lane] = size * (fourth * (square * square) / 384.0);
        many->flat[j][lane] = 2.0 * size;
        many->rise[j][lane] = 0.25 * size * first * cell;
    }
}

/* Set the largest deviations of the observed displacement and velocity from a line over cells of all levels. */
static void take_tilts(vi_lane_group *g, int lane, int modes, const bounds bound[])
{
    vi_many_modes *many = &g->many;
    const int point = VI_LANES_CONTACTS;
    const double w = g->angular_frequency[lane], steady = steady_size(g, lane, point);
    for (int level = 0; level <= (int)many->last[lane]; ++level) {
        const double length = many->rows[level].cells[lane] * g->cell[lane], eighth = 0.125 * length * length;
        vi_lane_array *sag = many->sag[level], *tilt = many->tilt[level];
        for (int j = 0; j < modes; ++j) {
            const double shape = fabs(many->shape[point][j][lane]);
            sag[j][lane] = shape * vi_min(bound[j].second * eighth, 2.0);
            tilt[j][lane] = shape * vi_min(bound[j].third * eighth, 2.0 * bound[j].first);
        }
        sag[VI_REAL_MODES][lane] = steady * vi_min(w * w * eighth, 2.0);
        tilt[VI_REAL_MODES][lane] = w * sag[VI_REAL_MODES][lane];
    }
}

/* Set the shape of a point in the real modes. */
static void take_shape(const vi_lane_group *g, int lane, const vi_lanes_plan *plan, const double shape[], double real[])
{
    const int own = vi_own_modes(plan);
    for (int j = 0; j < own; ++j) {
        real[j] = plan->coupled ? 0.0 : shape[j];
        for (int i = 0; i < plan->modes && plan->coupled; ++i) {
            real[j] += shape[i] * g->many.to_state[i][j][lane];
        }
    }
    for (int j = own; j < vi_real_modes(plan); ++j) {
        const int k = (j - own) / 2, part = (j - own) % 2;
        real[j] = 0.0;
        for (int i = 0; i < own; ++i) {
            real[j] += real[i] * g->sines->steady[k][i][part][lane];
        }
    }
}

/* Set the changes of the real modes that take away a unit of approach. */
static void take_kick(vi_lane_group *g, int lane, int c, const vi_lanes_plan *plan, const double kick[])
{
    const double none[VI_LANES_MODES] = {0.0};
    double shift[VI_REAL_MODES] = {0.0}, real[VI_REAL_MODES];
    if (plan->coupled) {
        vi_lane_split(g->coupling, none, kick, shift, real);
    }
    for (int j = 0; j < vi_real_modes(plan); ++j) {
        g->many.shift[c][j][lane] = shift[j];
        g->many.kick[c][j][lane] = plan->coupled ? real[j] : j < plan->modes ? kick[j] : 0.0;
    }
}

/* Set a contact of a point; false where it is invalid, or the start is not clear of it. */
static bool take_contact(vi_lane_group *g, int lane, int c, const vi_lanes_plan *plan, const vi_lanes_points *points,
                         int64_t point, const double q[])
{
    const int64_t i = c * points->count + point;
    const int modes = plan->modes;
    double shape[VI_LANES_MODES], kick[VI_LANES_MODES], real[VI_REAL_MODES];
    double mobility = 0.0, start = 0.0, size = fabs(points->position[i]);
    for (int j = 0; j < modes; ++j) {
        const int64_t at = (c * modes + j) * points->count + point;
        shape[j] = points->shape[at];
        mobility += shape[j] * points->impulse[at];
        start += shape[j] * q[j];
        size += fabs(shape[j]) * fabs(q[j]);
    }
    take_shape(g, lane, plan, shape, real);
    for (int j = 0; j < vi_real_modes(plan); ++j) {
        size += fabs(real[j]) * fabs(g->many.rest[j][lane]);
    }
    const double clearance = points->direction[i] * (points->position[i] - start);
    if (!vi_lane_is_contact(points, i) || !(mobility > 0.0) || !isfinite(mobility)
        || !(clearance > VI_ROUNDING * size)) {
        return false;
    }
    take_point(g, lane, c, vi_real_modes(plan), points->direction[i], points->position[i], real);
    for (int j = 0; j < modes; ++j) {
        kick[j] = points->direction[i] * points->impulse[(c * modes + j) * points->count + point] / mobility;
    }
    take_kick(g, lane, c, plan, kick);
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

/* Set the step of all modes and of the force over this length. */
static void take_step(const vi_lane_group *g, int lane, int modes, const vi_mode mode[], double length,
                      vi_lane_array step[][4], double *turn_cosine, double *turn_sine)
{
    for (int j = 0; j < modes; ++j) {
        double phi[4];
        propagate(&mode[j], length, phi);
        for (int i = 0; i < 4; ++i) {
            step[j][i][lane] = phi[i];
        }
    }
    vi_lane_turn(g->angular_frequency[lane] * length, turn_cosine, turn_sine);
}

static void take_steps(vi_lane_group *g, int lane, int modes, const vi_mode mode[])
{
    vi_many_modes *many = &g->many;
    const double cell = g->cell[lane];
    take_step(g, lane, modes, mode, cell, many->half, &many->half_cosine[lane], &many->half_sine[lane]);
    take_step(g, lane, modes, mode, 2.0 * cell, many->two, &many->two_cosine[lane], &many->two_sine[lane]);
    for (int level = 0; level <= (int)many->last[lane]; ++level) {
        vi_level_rows *of = &many->rows[level];
        take_step(g, lane, modes, mode, of->cells[lane] * cell, of->step, &of->turn_cosine[lane], &of->turn_sine[lane]);
    }
}

/* Copy some arrays over the lanes, in one lane. */
static void copy_rows(int lane, int count, const vi_lane_array from[], vi_lane_array to[])
{
    for (int i = 0; i < count; ++i) {
        to[i][lane] = from[i][lane];
    }
}

void vi_lane_put_level(vi_lane_group *g, int lane, int modes, int contacts)
{
    const vi_level_rows *from = &g->many.rows[(int)g->many.level[lane]];
    vi_level_rows *to = &g->many.present;
    copy_rows(lane, 4 * modes, from->step[0], to->step[0]);
    for (int c = 0; c < contacts; ++c) {
        copy_rows(lane, modes + 1, from->bulge[c], to->bulge[c]);
    }
    copy_rows(lane, 1, &from->turn_cosine, &to->turn_cosine);
    copy_rows(lane, 1, &from->turn_sine, &to->turn_sine);
    copy_rows(lane, 1, &from->cells, &to->cells);
    copy_rows(lane, 1, &from->rate, &to->rate);
}

bool vi_lane_take_many(vi_lane_group *g, int lane, const vi_lanes_plan *plan, const vi_lanes_points *points,
                       int64_t point, const double q[], const double p[])
{
    const int modes = vi_real_modes(plan);
    vi_mode mode[VI_REAL_MODES];
    bounds bound[VI_REAL_MODES];
    double fastest = 0.0, observed[VI_LANES_MODES], real[VI_REAL_MODES];
    if (!vi_lane_take_modes(g, lane, plan, points, point, q, p, mode)) {
        return false;
    }
    for (int j = 0; j < modes; ++j) {
        bound[j] = take_amplitude(g, lane, j, &mode[j]);
        g->many.pull[j][lane] = bound[j].second;
        fastest = vi_max(fastest, mode[j].fastest);
    }
    if (!take_levels(g, lane, fastest)) {
        return false;
    }
    for (int j = 0; j < modes; ++j) {
        g->many.drag[j][lane] = 2.0 * g->many.decay[j][lane] * g->cell[lane];
        g->many.spring[j][lane] = g->many.stiffness[j][lane] * (g->cell[lane] * g->cell[lane]);
    }
    take_steps(g, lane, modes, mode);
    for (int c = 0; c < plan->contacts; ++c) {
        if (!take_contact(g, lane, c, plan, points, point, q)) {
            return false;
        }
        take_bulges(g, lane, c, modes, bound);
    }
    for (int j = 0; j < plan->modes; ++j) {
        observed[j] = points->observed[j * points->count + point];
    }
    take_shape(g, lane, plan, observed, real);
    take_point(g, lane, VI_LANES_CONTACTS, modes, 1.0, 0.0, real);
    take_tilts(g, lane, modes, bound);
    take_waves(g, lane, modes, bound);
    vi_lane_put_level(g, lane, modes, plan->contacts);
    return true;
}
