#include "body/modal/structure/random_flight.h"

#include <math.h>

#include "body/modal/loads.h"
#include "motion/majorant.h"

#if VI_SIGNALS > 0

/* Most intervals of one flight, and fewest that repay it. */
enum { MOST = 64, FEWEST = 3 };

/* Longest interval, in units of 1 / fastest rate, that a series of RESPONSE_ORDER terms resolves to rounding. */
static const double LONGEST = 2.0;
enum { RESPONSE_ORDER = 36 };

/* ---- responses ---- */

/* Displacement and velocity after u seconds: from (x, v) without a load, less (x, v) themselves, or from rest under
 * the load t^power. A Taylor series; power < 0: no load. */
static void respond(const vi_mode *mode, double x, double v, int power, double u, double change[2])
{
    double before = x, now = v, scale = u; /* coefficients n and n + 1; scale: u^(n + 1) */
    change[0] = v * u;
    change[1] = 0.0;
    for (int n = 0; n < RESPONSE_ORDER; ++n) {
        const double order = (double)n;
        const double next = ((n == power ? 1.0 : 0.0) - 2.0 * mode->decay * (order + 1.0) * now - mode->stiffness * before)
                            / ((order + 1.0) * (order + 2.0));
        change[1] += (order + 2.0) * next * scale;
        scale *= u;
        change[0] += next * scale;
        before = now;
        now = next;
    }
}

static void find_response(vi_interval_response *r, const vi_mode *mode, const vi_random *random)
{
    double column[2], of_power[VI_SPLINE_ORDER][2];
    *r = (vi_interval_response){.stiffness = mode->stiffness, .decay = mode->decay, .interval = random->interval};
    for (int i = 0; i < 2; ++i) {
        respond(mode, i == 0 ? 1.0 : 0.0, i == 1 ? 1.0 : 0.0, -1, random->interval, column);
        r->of_state[0][i] = column[0];
        r->of_state[1][i] = column[1];
    }
    for (int n = 0; n < VI_SPLINE_ORDER; ++n) {
        respond(mode, 0.0, 0.0, n, random->interval, of_power[n]);
    }
    for (int i = 0; i < VI_SPLINE_ORDER; ++i) {
        double unit[VI_SPLINE_ORDER] = {0.0}, power[VI_SPLINE_ORDER];
        unit[i] = 1.0;
        vi_random_polynomial(random, unit, power);
        for (int n = 0; n < VI_SPLINE_ORDER; ++n) {
            r->of_spline[i][0] += power[n] * of_power[n][0];
            r->of_spline[i][1] += power[n] * of_power[n][1];
        }
    }
    r->of_held[0] = of_power[0][0];
    r->of_held[1] = of_power[0][1];
}

static void find_responses(const vi_structure *s, const vi_random *random)
{
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        vi_interval_response *r = &s->loads->response[j];
        const vi_mode *mode = &s->model->mode[j];
        if (r->interval != random->interval || r->stiffness != mode->stiffness || r->decay != mode->decay) {
            find_response(r, mode, random);
        }
    }
}

/* ---- intervals that fit ---- */

/* Is the random load the only one besides constant inputs, are all contacts clear, and does no mode grow by itself? */
static bool is_simple(const vi_structure *s)
{
    const vi_structure_model *model = s->model;
    const vi_structure_state *state = s->state;
    if (vi_structure_sines(model) > 0 || vi_structure_stops_move(model) || vi_structure_grows(model) || model->coupled
        || model->varies || state->exchange.on || s->record->periods || state->follow_energies) {
        return false;
    }
    for (int k = 0; k < model->contacts; ++k) {
        if (model->stop[k] != VI_NO_STOP && state->status[k] != VI_CONTACT_FREE) {
            return false;
        }
    }
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const vi_mode *mode = &model->mode[j];
        const bool may_grow = !(mode->stiffness >= 0.0 && mode->decay >= 0.0);
        if (may_grow || mode->force != 0.0 || state->input_rate[j] != 0.0) {
            return false;
        }
    }
    return true;
}

/* The one signal that is not 0, if it is random and starts an interval now; -1: there is no such signal. *room: seconds
 * up to the next change of any other signal, or the end of this one. */
static int lone_signal(const vi_structure *s, vi_twofold time, double *room, int64_t *interval, vi_twofold *since)
{
    const vi_signal_loads *loads = s->loads;
    int found = -1;
    for (int k = 0; k < loads->count; ++k) {
        vi_piece piece;
        vi_signal *const signal = &s->loads->signal[k];
        const vi_twofold after = vi_twofold_difference(time, (vi_twofold){signal->start, 0.0});
        const double resolution = vi_piece_resolution(time);
        const bool acts = signal->kind == VI_RANDOM && after.high >= -resolution
                          && !(signal->duration > 0.0 && signal->duration - after.high <= resolution);
        if (acts) {
            const vi_twofold here = after.high < 0.0 ? (vi_twofold){0.0, 0.0} : after;
            if (found >= 0 || !vi_random_is_knot(signal->random, here, resolution, interval)) {
                return -1;
            }
            found = k;
            *since = here;
            *room = signal->duration > 0.0 ? vi_min(*room, signal->duration - here.high) : *room;
            continue;
        }
        vi_signal_piece(signal, time, &piece);
        if (piece.degree > 0 || piece.coefficient[0] != 0.0) {
            return -1;
        }
        *room = vi_min(*room, piece.length);
    }
    return found;
}

/* Largest speed of change of each mode's velocity over `length` seconds for loads up to `size` times force[]:
 * equations.md 2.2. */
static void bound_accelerations(const vi_structure *s, const double force[], double size, double length, double most[])
{
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        const vi_mode *mode = &s->model->mode[j];
        const double q = s->state->q[j], p = s->state->p[j], load = fabs(s->state->input[j]) + fabs(force[j]) * size;
        const double energy = sqrt(p * p + mode->stiffness * q * q) + load * length;
        most[j] = load + sqrt(4.0 * mode->decay * mode->decay + mode->stiffness) * energy;
    }
}

/* Time in which a point surely does not rise by `room`. */
static double time_below(const vi_structure *s, const double shape[], double sign, double room, const double most[])
{
    double bound = 0.0;
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        bound += fabs(shape[j]) * most[j];
    }
    return room > 0.0 ? vi_parabola_root(room, sign * vi_structure_at(s->model, shape, s->state->p), bound) : 0.0;
}

/* The same for the largest and the smallest displacement so far. */
static double time_within(const vi_structure *s, const double shape[], double high, double low, const double most[])
{
    const double here = vi_structure_at(s->model, shape, s->state->q);
    return vi_min(time_below(s, shape, 1.0, high - here, most), time_below(s, shape, -1.0, here - low, most));
}

/* Time in which no stop and no record of an extreme can be met. */
static double certain_time(const vi_structure *s, const double most[])
{
    const vi_structure_model *model = s->model;
    const vi_record *record = s->record;
    double time = HUGE_VAL;
    for (int k = 0; k < model->contacts; ++k) {
        if (vi_structure_watched(s, k)) {
            time = vi_min(time, time_below(s, model->shape[k], vi_structure_direction(s, k),
                                           vi_structure_clearance(s, k), most));
        }
    }
    if (record->extrema) {
        time = vi_min(time, time_within(s, model->observed, record->displacement_max, record->displacement_min, most));
        for (int i = 0; i < model->further; ++i) {
            const vi_record_point *point = &record->point[i];
            time = vi_min(time, time_within(s, model->shape[model->contacts + i], point->displacement_max,
                                            point->displacement_min, most));
        }
    }
    return time;
}

/* ---- the flight ---- */

static void step_modes(const vi_structure *s, const double force[], double amplitude, const double coefficient[],
                       int intervals)
{
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        const vi_interval_response *r = &s->loads->response[j];
        const double held = s->state->input[j], factor = amplitude * force[j];
        double q = s->state->q[j], p = s->state->p[j];
        for (int i = 0; i < intervals; ++i) {
            const double *c = coefficient + i;
            double change[2];
            for (int n = 0; n < 2; ++n) {
                const double load = (r->of_spline[0][n] * c[0] + r->of_spline[1][n] * c[1])
                                    + (r->of_spline[2][n] * c[2] + r->of_spline[3][n] * c[3]);
                change[n] = (r->of_state[n][0] * q + r->of_state[n][1] * p) + (factor * load + r->of_held[n] * held);
            }
            q += change[0];
            p += change[1];
        }
        s->state->q[j] = q;
        s->state->p[j] = p;
    }
}

double vi_random_flight(const vi_structure *s, vi_instant target)
{
    vi_signal_loads *loads = s->loads;
    if (loads == NULL || !is_simple(s)) {
        return 0.0;
    }
    vi_twofold time, since = {0.0, 0.0};
    time.high = vi_clock_time_twofold(&s->model->clock, s->state->now, &time.low);
    double room = vi_clock_elapsed(&s->model->clock, s->state->now, target);
    int64_t first;
    const int k = lone_signal(s, time, &room, &first, &since);
    if (k < 0 || s->model->fastest * loads->random[k].interval > LONGEST) {
        return 0.0;
    }
    vi_signal *const signal = &loads->signal[k];
    const double interval = signal->random->interval, *force = loads->force[k];
    double coefficient[MOST + VI_SPLINE_ORDER], most[VI_MODES], size = 0.0;
    int count = (int)vi_min((double)MOST, room / interval);
    if (count < FEWEST) {
        return 0.0;
    }
    count = vi_random_coefficients(signal->random, signal->transform, signal->seed, first, count, coefficient);
    for (int i = 0; i < count + VI_SPLINE_ORDER - 1; ++i) {
        size = vi_max(size, fabs(coefficient[i]));
    }
    bound_accelerations(s, force, fabs(loads->amplitude[k]) * size, (double)count * interval, most);
    count = (int)vi_min((double)count, certain_time(s, most) / interval);
    if (count < FEWEST) {
        return 0.0;
    }
    vi_budget_spend(&s->state->budget, (int64_t)count * vi_structure_modes(s->model));
    find_responses(s, signal->random);
    step_modes(s, force, loads->amplitude[k], coefficient, count);
    const double last = (double)(first + count), end = last * interval;
    return (end - since.high) + (fma(last, interval, -end) - since.low);
}

#endif
