#include "body/modal/power_flow.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "motion/majorant.h"

/* Most passes of the iteration; four to nine are usual. */
enum { MOST_PASSES = 40, EARLY_PASSES = 4 }; /* changes may grow in early passes */
/* Change of the depths to come, relative to the largest, at which the iteration ends: these roundings, and this share
 * of the tolerance. */
static const double ROUNDINGS = 8.0, SHARE = 1e-2;
/* Factor on the change to come, which is taken as the last change times the last ratio of two changes. */
static const double CAUTION = 16.0;
/* Largest ripple between nodes, in sums of the last two coefficients. */
static const double RIPPLE = 8.0;
/* Least depth during the iteration, relative to the depth at the start. */
static const double LEAST_DEPTH = 1e-3;

/* Numbers of a row of modes in whole blocks; those behind the last mode are 0. */
static int width_of(const vi_power_start *start)
{
    return (vi_structure_modes(start->model) + VI_COLUMNS - 1) / VI_COLUMNS * VI_COLUMNS;
}

/* Copy a number of each mode to a row. */
static void fill_row(const vi_power_start *start, const double from[], double row[VI_POWER_ROW])
{
    const int modes = vi_structure_modes(start->model), width = width_of(start);
    memcpy(row, from, (size_t)modes * sizeof row[0]);
    for (int j = modes; j < width; ++j) {
        row[j] = 0.0;
    }
}

/* Force of a power law without damping. A square root is several times faster than a power. */
static double plain_force(const vi_press *press, double depth)
{
    return press->stiffness * (press->exponent == 1.5 ? depth * sqrt(depth) : pow(depth, press->exponent));
}

/* Begin a contact: its rate, and its acceleration without the contacts' forces. */
static void begin_contact(vi_power_start *start, vi_power_contact *contact, const vi_drift_start *state, int port,
                          double depth)
{
    const int width = width_of(start);
    double acceleration[VI_POWER_ROW];
    contact->port = port;
    contact->sign = state->sign[port];
    contact->press = state->press[port];
    contact->depth = depth;
    contact->plain = plain_force(&contact->press, depth);
    fill_row(start, start->model->shape[port], contact->toward);
    for (int j = 0; j < width; j += VI_LANES) {
        for (int i = j; i < j + VI_LANES; ++i) {
            contact->toward[i] *= contact->sign;
            acceleration[i] = start->gain[i] + start->tables->force[i] * state->drive.phase.cosine;
        }
    }
    contact->rate = vi_row_dot(contact->toward, start->p, width);
    contact->acceleration = vi_row_dot(contact->toward, acceleration, width);
}

/* Add the accelerations by the forces of the contacts. */
static void add_accelerations(vi_power_start *start)
{
    for (int l = 0; l < start->contacts; ++l) {
        const vi_power_contact *by = &start->contact[l];
        const double force = by->plain * (1.0 + by->press.damping * by->rate);
        for (int i = 0; i < start->contacts; ++i) {
            vi_power_contact *of = &start->contact[i];
            of->acceleration -= of->sign * by->sign * start->model->compliance[of->port][by->port] * force;
        }
    }
}

/* Set the loads of the modes, and their rates of change. */
static void load_modes(vi_power_start *start, const vi_drift_start *state, double u)
{
    const double *restrict stiffness = start->tables->stiffness, *restrict decay = start->tables->decay;
    double q[VI_POWER_ROW], held[VI_POWER_ROW];
    fill_row(start, state->q, q);
    fill_row(start, state->drive.held, held);
    for (int j = 0; j < width_of(start); j += VI_LANES) {
        for (int i = j; i < j + VI_LANES; ++i) {
            const double load = held[i] + start->slope[i] * u - stiffness[i] * q[i];
            start->load[i] = load;
            start->gain[i] = load - 2.0 * decay[i] * start->p[i];
            start->turn[i] = start->slope[i] - stiffness[i] * start->p[i];
        }
    }
}

void vi_power_begin(vi_power_start *start, const vi_structure_model *model, const vi_power_tables *tables,
                    const vi_drift_start *state, double u, int contacts, const int port[], const double depth[])
{
    start->model = model;
    start->tables = tables;
    start->contacts = contacts;
    start->cosine = state->drive.phase.cosine;
    start->sine = state->drive.phase.sine;
    start->ramps = false;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        start->ramps = start->ramps || state->drive.held_rate[j] != 0.0;
    }
    fill_row(start, state->p, start->p);
    fill_row(start, state->drive.held_rate, start->slope);
    load_modes(start, state, u);
    for (int i = 0; i < contacts; ++i) {
        begin_contact(start, &start->contact[i], state, port[i], depth[port[i]]);
    }
    add_accelerations(start);
}

/* ---- motion at the nodes ---- */

/* Add the response of a point with this shape, a row, to rates and loads of the modes. */
static void add_modes(const vi_power_start *start, const vi_power_level *level, const double shape[],
                      const double rate[], const double load[], double value[VI_NODES])
{
    const int modes = vi_structure_modes(start->model);
    double by_rate[VI_POWER_ROW], by_load[VI_POWER_ROW];
    for (int j = 0; j < width_of(start); j += VI_LANES) {
        for (int i = j; i < j + VI_LANES; ++i) {
            by_rate[i] = shape[i] * rate[i];
            by_load[i] = shape[i] * load[i];
        }
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
        by_ramp[j] = shape[j] * start->slope[j];
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

/* Maxima that are found side by side, since each comparison waits for the one before. */
enum { MAXIMA = 4 };

/* Largest change of the depths; *largest: at least the largest depth. */
static double largest_change(const double depth[VI_NODES], const double before[VI_NODES], double *largest)
{
    double change[MAXIMA] = {0.0}, most[MAXIMA] = {*largest, 0.0, 0.0, 0.0};
    for (int i = 0; i < VI_NODES; i += MAXIMA) {
        for (int l = 0; l < MAXIMA; ++l) {
            change[l] = vi_max(change[l], fabs(depth[i + l] - before[i + l]));
            most[l] = vi_max(most[l], depth[i + l]);
        }
    }
    *largest = vi_max(vi_max(most[0], most[1]), vi_max(most[2], most[3]));
    return vi_max(vi_max(change[0], change[1]), vi_max(change[2], change[3]));
}

/* Set the depths that follow from the forces. Returns their largest change, relative to the largest depth. */
static double respond(const vi_power_start *start, const vi_power_level *level, const free_motion *motion,
                      vi_power_course course[])
{
    double worst = 0.0;
    for (int k = 0; k < start->contacts; ++k) {
        const vi_power_contact *contact = &start->contact[k];
        double depth[VI_NODES], largest = contact->depth;
        memcpy(depth, motion->depth[k], sizeof depth);
        add_forces(start, course, level->yield, contact->port, contact->sign, depth);
        const double change = largest_change(depth, course[k].depth, &largest);
        worst = change <= worst * largest ? worst : change / largest;
        memcpy(course[k].depth, depth, sizeof depth);
        if (contact->press.damping != 0.0) {
            memcpy(course[k].rate, motion->rate[k], sizeof course[k].rate);
            add_forces(start, course, level->yield_rate, contact->port, contact->sign, course[k].rate);
        }
    }
    return worst;
}

/* Force of a contact at the start, and its first two derivatives. The second one leaves out the damping. */
static void start_force(const vi_power_contact *contact, double force[VI_GROWTHS])
{
    const double n = contact->press.exponent, damping = contact->press.damping, speed = contact->rate / contact->depth;
    const double plain = contact->plain, share = 1.0 + damping * contact->rate;
    force[0] = plain * share;
    force[1] = plain * (n * speed * share + damping * contact->acceleration);
    force[2] = plain * n * (contact->acceleration / contact->depth + (n - 1.0) * speed * speed);
}

/* First guess: the free motion less the response to forces that grow as they do at the start. */
static void guess(const vi_power_start *start, const vi_power_level *level, const free_motion *motion,
                  vi_power_course course[])
{
    double force[VI_PORTS][VI_GROWTHS], away[VI_GROWTHS];
    for (int l = 0; l < start->contacts; ++l) {
        start_force(&start->contact[l], force[l]);
    }
    for (int k = 0; k < start->contacts; ++k) {
        const vi_power_contact *contact = &start->contact[k];
        memcpy(course[k].depth, motion->depth[k], sizeof course[k].depth);
        memcpy(course[k].rate, motion->rate[k], sizeof course[k].rate);
        for (int l = 0; l < start->contacts; ++l) {
            const vi_power_contact *by = &start->contact[l];
            const int pair = vi_pair_of_contacts(contact->port, by->port);
            for (int m = 0; m < VI_GROWTHS; ++m) {
                away[m] = -contact->sign * by->sign * force[l][m];
            }
            vi_rows_combine(course[k].depth, level->grows[pair][0], VI_NODES, away, VI_GROWTHS, VI_NODES);
            vi_rows_combine(course[k].rate, level->grows_rate[pair][0], VI_NODES, away, VI_GROWTHS, VI_NODES);
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
    vi_legendre_series(&start->tables->basis, course->depth, course->depth_series);
    vi_legendre_series(&start->tables->basis, course->force, course->force_series);
    if (damping != 0.0) {
        vi_legendre_series(&start->tables->basis, course->rate, course->rate_series);
    }
    return vi_power_least(course->depth_series) > 0.0
           && (damping == 0.0 || 1.0 + damping * vi_power_least(course->rate_series) > 0.0);
}

bool vi_power_solve(const vi_power_start *start, const vi_power_level *level, vi_power_course course[])
{
    const double close = vi_max(ROUNDINGS * DBL_EPSILON, SHARE * start->model->tolerance);
    double change = HUGE_VAL, before = HUGE_VAL, left = HUGE_VAL; /* changes, and the change to come */
    free_motion motion;
    leave_free(start, level, &motion);
    guess(start, level, &motion, course);
    for (int pass = 0; pass < MOST_PASSES && left > close && (pass < EARLY_PASSES || change < before); ++pass) {
        before = change;
        change = respond(start, level, &motion, course);
        left = change < before && pass > 0 ? change * vi_min(1.0, CAUTION * (change / before)) : change;
        for (int k = 0; k < start->contacts; ++k) {
            press_nodes(&start->contact[k], &course[k]);
        }
    }
    bool pressed = left <= close;
    for (int k = 0; k < start->contacts && pressed; ++k) {
        pressed = stays_pressed(start, &start->contact[k], &course[k]);
    }
    return pressed;
}

void vi_power_observe(const vi_power_start *start, const vi_power_level *level, const vi_power_course course[],
                      double moved[VI_NODES])
{
    double shape[VI_POWER_ROW];
    fill_row(start, start->model->observed, shape);
    memset(moved, 0, VI_NODES * sizeof moved[0]);
    add_modes(start, level, shape, start->p, start->load, moved);
    add_ramps(start, level, shape, moved);
    add_wave(start, 1.0, level->wave_seen, moved);
    add_forces(start, course, level->seen, -1, 1.0, moved);
}

void vi_power_other(const vi_power_start *start, const vi_power_level *level, const vi_power_course course[], int port,
                    double sign, double depth, double value[VI_NODES])
{
    double toward[VI_POWER_ROW];
    fill_row(start, start->model->shape[port], toward);
    for (int j = 0; j < vi_structure_modes(start->model); ++j) {
        toward[j] *= sign;
    }
    for (int i = 0; i < VI_NODES; ++i) {
        value[i] = depth;
    }
    add_modes(start, level, toward, start->p, start->load, value);
    add_ramps(start, level, toward, value);
    add_wave(start, sign, level->wave[port], value);
    add_forces(start, course, level->yield, port, sign, value);
}

/* Add the response of the modes at the end, in displacement or velocity, to the force of a contact. moment: a row for
 * each coefficient. */
static void push(const vi_power_contact *contact, const vi_power_course *course, const double moment[], int width,
                 double value[])
{
    double pushed[VI_POWER_ROW];
    memset(pushed, 0, (size_t)width * sizeof pushed[0]);
    vi_rows_combine(pushed, moment, VI_POWER_ROW, course->force_series, VI_NODES, width);
    for (int j = 0; j < width; j += VI_LANES) {
        for (int i = j; i < j + VI_LANES; ++i) {
            value[i] -= contact->toward[i] * pushed[i];
        }
    }
}

/* Displacements and velocities of the modes at the end without the contacts, from the state at the start. */
static void leave_modes(const vi_power_start *start, const vi_power_level *level, double x[], double v[])
{
    const double *restrict by_load = level->moment[0], *restrict second = level->moment[1];
    for (int j = 0; j < width_of(start); j += VI_LANES) {
        for (int i = j; i < j + VI_LANES; ++i) {
            const double by_rate = level->of_rate_end[i], force = start->tables->force[i];
            const double by_ramp = 0.5 * level->step * (by_load[i] + second[i]);
            const double wave = start->cosine * level->wave_end[0][i] - start->sine * level->wave_end[1][i];
            const double rate = start->cosine * level->wave_end_rate[0][i] - start->sine * level->wave_end_rate[1][i];
            x[i] = start->p[i] * by_rate + start->load[i] * by_load[i] + start->slope[i] * by_ramp + force * wave;
            v[i] = start->gain[i] * by_rate + start->turn[i] * by_load[i] + force * rate;
        }
    }
}

void vi_power_end(const vi_power_start *start, const vi_power_level *level, const vi_power_course course[], double q[],
                  double p[])
{
    double x[VI_POWER_ROW], v[VI_POWER_ROW];
    leave_modes(start, level, x, v);
    for (int k = 0; k < start->contacts; ++k) {
        push(&start->contact[k], &course[k], level->moment[0], width_of(start), x);
        push(&start->contact[k], &course[k], level->moment_rate[0], width_of(start), v);
    }
    for (int j = 0; j < vi_structure_modes(start->model); ++j) {
        q[j] += x[j];
        p[j] += v[j];
    }
}
