#include "body/modal/power_flow.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "motion/majorant.h"

/* Most passes of the iteration; four to nine are usual. */
enum { MOST_PASSES = 40, EARLY_PASSES = 4 }; /* changes may grow in early passes */
/* Change of the depths, relative to the largest, at which the iteration ends: these roundings, and this share of the
 * tolerance. */
static const double ROUNDINGS = 8.0, SHARE = 1e-2;
/* Largest ripple between nodes, in sums of the last two coefficients. */
static const double RIPPLE = 8.0;
/* Least depth during the iteration, relative to the depth at the start. */
static const double LEAST_DEPTH = 1e-3;

/* Begin a contact: its rate, and its acceleration without the contacts' forces. */
static void begin_contact(vi_power_start *start, vi_power_contact *contact, const vi_drift_start *state, int port,
                          double depth)
{
    const double *shape = start->model->shape[port];
    double rate = 0.0, acceleration = 0.0;
    contact->port = port;
    contact->sign = state->sign[port];
    contact->press = state->press[port];
    contact->depth = depth;
    for (int j = 0; j < vi_structure_modes(start->model); ++j) {
        const double toward = contact->sign * shape[j];
        contact->toward[j] = toward;
        rate += toward * state->p[j];
        acceleration += toward * (start->gain[j] + start->model->mode[j].force * state->cosine);
    }
    contact->rate = rate;
    contact->acceleration = acceleration;
}

/* Add the accelerations by the forces of the contacts. */
static void add_accelerations(vi_power_start *start)
{
    for (int l = 0; l < start->contacts; ++l) {
        const vi_power_contact *by = &start->contact[l];
        const double force = by->press.stiffness * pow(by->depth, by->press.exponent)
                             * (1.0 + by->press.damping * by->rate);
        for (int i = 0; i < start->contacts; ++i) {
            vi_power_contact *of = &start->contact[i];
            of->acceleration -= of->sign * by->sign * start->model->compliance[of->port][by->port] * force;
        }
    }
}

void vi_power_begin(vi_power_start *start, const vi_structure_model *model, const vi_legendre *basis,
                    const vi_drift_start *state, double u, int contacts, const int port[], const double depth[])
{
    start->model = model;
    start->basis = basis;
    start->contacts = contacts;
    start->cosine = state->cosine;
    start->sine = state->sine;
    start->p = state->p;
    start->held_rate = state->held_rate;
    start->ramps = false;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const vi_mode *mode = &model->mode[j];
        const double p = state->p[j], slope = state->held_rate[j];
        const double load = state->held[j] + slope * u - mode->stiffness * state->q[j];
        start->load[j] = load;
        start->gain[j] = load - 2.0 * mode->decay * p;
        start->turn[j] = slope - mode->stiffness * p;
        start->ramps = start->ramps || slope != 0.0;
    }
    for (int i = 0; i < contacts; ++i) {
        begin_contact(start, &start->contact[i], state, port[i], depth[port[i]]);
    }
    add_accelerations(start);
}

/* ---- motion at the nodes ---- */

/* Add the response of a point with this shape to rates and loads of the modes. */
static void add_modes(const vi_power_start *start, const vi_power_level *level, const double shape[],
                      const double rate[], const double load[], double value[VI_NODES])
{
    const int modes = vi_structure_modes(start->model);
    double by_rate[VI_MODES], by_load[VI_MODES];
    for (int j = 0; j < modes; ++j) {
        by_rate[j] = shape[j] * rate[j];
        by_load[j] = shape[j] * load[j];
    }
    vi_rows_combine(value, level->of_rate[0], VI_NODES, by_rate, modes, VI_NODES);
    vi_rows_combine(value, level->of_load[0], VI_NODES, by_load, modes, VI_NODES);
}

/* Add the response of a point with this shape to input loads that slope. */
static void add_ramps(const vi_power_start *start, const vi_power_level *level, const double shape[],
                      double value[VI_NODES])
{
    double by_ramp[VI_MODES];
    for (int j = 0; j < vi_structure_modes(start->model); ++j) {
        by_ramp[j] = shape[j] * start->held_rate[j];
    }
    if (start->ramps) {
        vi_rows_combine(value, level->of_ramp[0], VI_NODES, by_ramp, vi_structure_modes(start->model), VI_NODES);
    }
}

/* Add the response to the forcing, cos(phase + turn) = cos(phase) cos(turn) - sin(phase) sin(turn). */
static void add_wave(const vi_power_start *start, double sign, const double wave[2][VI_NODES], double value[VI_NODES])
{
    const double part[2] = {sign * start->cosine, -sign * start->sine};
    vi_rows_combine(value, wave[0], VI_NODES, part, 2, VI_NODES);
}

/* Add the responses of a point with this sign to the forces of all contacts, which act away from their stops.
 * `port`: the point's contact; -1: the observed point. */
static void add_forces(const vi_power_start *start, const vi_power_course course[], const vi_node_response table[],
                       int port, double sign, double value[VI_NODES])
{
    for (int l = 0; l < start->contacts; ++l) {
        const vi_power_contact *by = &start->contact[l];
        const int entry = port < 0 ? by->port : vi_pair_of_contacts(port, by->port);
        double away[VI_NODES];
        for (int k = 0; k < VI_NODES; ++k) {
            away[k] = -sign * by->sign * course[l].force[k];
        }
        vi_rows_combine(value, table[entry][0], VI_NODES, away, VI_NODES, VI_NODES);
    }
}

/* ---- one step ---- */

static void press_nodes(const vi_power_contact *contact, vi_power_course *course)
{
    const vi_press *press = &contact->press;
    const double least = LEAST_DEPTH * contact->depth;
    double depth[VI_NODES];
    for (int i = 0; i < VI_NODES; ++i) {
        depth[i] = vi_max(least, course->depth[i]);
    }
    if (press->exponent == 1.5) { /* a square root is several times faster than a power */
        for (int i = 0; i < VI_NODES; ++i) {
            course->force[i] = press->stiffness * (depth[i] * sqrt(depth[i]));
        }
    } else {
        for (int i = 0; i < VI_NODES; ++i) {
            course->force[i] = press->stiffness * pow(depth[i], press->exponent);
        }
    }
    for (int i = 0; i < VI_NODES && press->damping != 0.0; ++i) {
        course->force[i] *= 1.0 + press->damping * course->rate[i];
    }
}

/* Depths and rates of the contacts at the nodes without their forces. */
typedef struct {
    double depth[VI_PORTS][VI_NODES], rate[VI_PORTS][VI_NODES];
} free_motion;

static void leave_free(const vi_power_start *start, const vi_power_level *level, free_motion *motion)
{
    for (int k = 0; k < start->contacts; ++k) {
        const vi_power_contact *contact = &start->contact[k];
        double *depth = motion->depth[k], *rate = motion->rate[k];
        for (int i = 0; i < VI_NODES; ++i) {
            depth[i] = contact->depth;
            rate[i] = contact->rate;
        }
        add_modes(start, level, contact->toward, start->p, start->load, depth);
        add_ramps(start, level, contact->toward, depth);
        add_wave(start, contact->sign, level->wave[contact->port], depth);
        if (contact->press.damping != 0.0) {
            add_modes(start, level, contact->toward, start->gain, start->turn, rate);
            add_wave(start, contact->sign, level->wave_rate[contact->port], rate);
        }
    }
}

/* Set the depths that follow from the forces. Returns their largest change, relative to the largest depth. */
static double respond(const vi_power_start *start, const vi_power_level *level, const free_motion *motion,
                      vi_power_course course[])
{
    double worst = 0.0;
    for (int k = 0; k < start->contacts; ++k) {
        const vi_power_contact *contact = &start->contact[k];
        double depth[VI_NODES], change = 0.0, largest = contact->depth;
        memcpy(depth, motion->depth[k], sizeof depth);
        add_forces(start, course, level->yield, contact->port, contact->sign, depth);
        for (int i = 0; i < VI_NODES; ++i) {
            change = vi_max(change, fabs(depth[i] - course[k].depth[i]));
            largest = vi_max(largest, depth[i]);
        }
        worst = change <= worst * largest ? worst : change / largest;
        memcpy(course[k].depth, depth, sizeof depth);
        if (contact->press.damping != 0.0) {
            memcpy(course[k].rate, motion->rate[k], sizeof course[k].rate);
            add_forces(start, course, level->yield_rate, contact->port, contact->sign, course[k].rate);
        }
    }
    return worst;
}

/* First guess: constant accelerations. */
static void guess(const vi_power_start *start, const vi_power_level *level, vi_power_course course[])
{
    for (int k = 0; k < start->contacts; ++k) {
        const vi_power_contact *contact = &start->contact[k];
        for (int i = 0; i < VI_NODES; ++i) {
            const double u = level->step * start->basis->node[i];
            course[k].depth[i] = contact->depth + u * (contact->rate + 0.5 * u * contact->acceleration);
            course[k].rate[i] = contact->rate + u * contact->acceleration;
        }
        press_nodes(contact, &course[k]);
    }
}

double vi_power_least(const double series[VI_NODES])
{
    const double last = fabs(series[VI_NODES - 1]) + fabs(series[VI_NODES - 2]);
    return series[0] - vi_legendre_spread(series) - RIPPLE * last;
}

/* Make the series. Do the depth, and the number with the force's sign, stay above zero? */
static bool stays_pressed(const vi_power_start *start, const vi_power_contact *contact, vi_power_course *course)
{
    const double damping = contact->press.damping;
    vi_legendre_series(start->basis, course->depth, course->depth_series);
    vi_legendre_series(start->basis, course->force, course->force_series);
    if (damping != 0.0) {
        vi_legendre_series(start->basis, course->rate, course->rate_series);
    }
    return vi_power_least(course->depth_series) > 0.0
           && (damping == 0.0 || 1.0 + damping * vi_power_least(course->rate_series) > 0.0);
}

bool vi_power_solve(const vi_power_start *start, const vi_power_level *level, vi_power_course course[])
{
    const double close = vi_max(ROUNDINGS * DBL_EPSILON, SHARE * start->model->tolerance);
    double change = HUGE_VAL, before = HUGE_VAL;
    free_motion motion;
    leave_free(start, level, &motion);
    guess(start, level, course);
    for (int pass = 0; pass < MOST_PASSES && change > close && (pass < EARLY_PASSES || change < before); ++pass) {
        before = change;
        change = respond(start, level, &motion, course);
        for (int k = 0; k < start->contacts; ++k) {
            press_nodes(&start->contact[k], &course[k]);
        }
    }
    bool pressed = change <= close;
    for (int k = 0; k < start->contacts && pressed; ++k) {
        pressed = stays_pressed(start, &start->contact[k], &course[k]);
    }
    return pressed;
}

void vi_power_observe(const vi_power_start *start, const vi_power_level *level, const vi_power_course course[],
                      double moved[VI_NODES])
{
    const double *shape = start->model->observed;
    memset(moved, 0, VI_NODES * sizeof moved[0]);
    add_modes(start, level, shape, start->p, start->load, moved);
    add_ramps(start, level, shape, moved);
    add_wave(start, 1.0, level->wave_seen, moved);
    add_forces(start, course, level->seen, -1, 1.0, moved);
}

void vi_power_other(const vi_power_start *start, const vi_power_level *level, const vi_power_course course[], int port,
                    double sign, double depth, double value[VI_NODES])
{
    double toward[VI_MODES];
    for (int j = 0; j < vi_structure_modes(start->model); ++j) {
        toward[j] = sign * start->model->shape[port][j];
    }
    for (int i = 0; i < VI_NODES; ++i) {
        value[i] = depth;
    }
    add_modes(start, level, toward, start->p, start->load, value);
    add_ramps(start, level, toward, value);
    add_wave(start, sign, level->wave[port], value);
    add_forces(start, course, level->yield, port, sign, value);
}

/* Add the response of the modes at the end, in displacement or velocity, to the force of a contact. */
static void push(const vi_power_contact *contact, const vi_power_course *course,
                 const double moment[VI_NODES][VI_POWER_ROW], int modes, double value[])
{
    const int width = (modes + VI_COLUMNS - 1) / VI_COLUMNS * VI_COLUMNS;
    double pushed[VI_POWER_ROW];
    memset(pushed, 0, (size_t)width * sizeof pushed[0]);
    vi_rows_combine(pushed, moment[0], VI_POWER_ROW, course->force_series, VI_NODES, width);
    for (int j = 0; j < modes; ++j) {
        value[j] -= contact->toward[j] * pushed[j];
    }
}

void vi_power_end(const vi_power_start *start, const vi_power_level *level, const vi_power_course course[], double q[],
                  double p[])
{
    const int modes = vi_structure_modes(start->model);
    double x[VI_MODES], v[VI_MODES];
    for (int j = 0; j < modes; ++j) {
        const double by_rate = level->of_rate_end[j], by_load = level->moment[0][j],
                     force = start->model->mode[j].force;
        const double by_ramp = 0.5 * level->step * (by_load + level->moment[1][j]);
        const double wave = start->cosine * level->wave_end[0][j] - start->sine * level->wave_end[1][j];
        const double wave_rate = start->cosine * level->wave_end_rate[0][j] - start->sine * level->wave_end_rate[1][j];
        x[j] = start->p[j] * by_rate + start->load[j] * by_load + start->held_rate[j] * by_ramp + force * wave;
        v[j] = start->gain[j] * by_rate + start->turn[j] * by_load + force * wave_rate;
    }
    for (int k = 0; k < start->contacts; ++k) {
        push(&start->contact[k], &course[k], level->moment, modes, x);
        push(&start->contact[k], &course[k], level->moment_rate, modes, v);
    }
    for (int j = 0; j < modes; ++j) {
        q[j] += x[j];
        p[j] += v[j];
    }
}
