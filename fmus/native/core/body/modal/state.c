#include "body/modal/state.h"

#include <math.h>
#include <string.h>

#include "body/landing.h"
#include "modes/growth.h"

/* ---- the model ---- */

void vi_structure_mode(vi_structure_model *model, int j, double natural, double damping_ratio, double force,
                       double angular_frequency)
{
    vi_mode_start(&model->mode[j], 1.0, 2.0 * damping_ratio * fabs(natural), natural * fabs(natural), force,
                  angular_frequency);
}

/* Bound on the rates of a full damping matrix. */
static double coupling_rate(const vi_structure_model *model)
{
    double most = 0.0;
    for (int i = 0; i < vi_structure_modes(model) && model->coupled; ++i) {
        double sum = 0.0;
        for (int j = 0; j < vi_structure_modes(model); ++j) {
            sum += fabs(model->coupling[i][j]);
        }
        most = vi_max(most, sum);
    }
    return most;
}

/* shape . impulse to 32 digits: the rounded value is returned, *low is its remainder. */
static double twofold_dot(const vi_structure_model *model, const double shape[], const double impulse[], double *low)
{
    double sum = 0.0, left = 0.0;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const double product = shape[j] * impulse[j], total = sum + product, part = total - sum;
        left += fma(shape[j], impulse[j], -product) + ((sum - (total - part)) + (product - part));
        sum = total;
    }
    const double high = sum + left;
    *low = left - (high - sum);
    return high;
}

void vi_structure_prepare(vi_structure_model *model)
{
    model->rows = model->contacts + model->further;
    for (int k = 0; k < model->contacts; ++k) {
        for (int l = 0; l < model->contacts; ++l) {
            model->mobility[k][l] = twofold_dot(model, model->shape[k], model->impulse[l], &model->mobility_low[k][l]);
            model->compliance[k][l] = vi_structure_at_body(model, model->shape[k], model->shape[l]);
        }
    }
    for (int k = 0; k < model->contacts; ++k) {
        model->at_observed[k] = memcmp(model->shape[k], model->observed, (size_t)vi_structure_free_modes(model) * sizeof(double)) == 0;
    }
    model->fastest = coupling_rate(model);
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const vi_mode *mode = &model->mode[j];
        double rate = model->coupled ? vi_max(mode->natural, mode->angular_frequency) : mode->fastest;
        for (int k = 0; k < vi_mode_sines(mode); ++k) {
            rate = vi_max(rate, mode->further[k].angular_frequency);
        }
        model->fastest = vi_max(model->fastest, rate);
    }
    model->radian = model->fastest > 0.0 ? 1.0 / model->fastest : 0.0;
    model->growth = VI_GROWING ? vi_growth_of(vi_structure_modes(model), model->mode,
                                              model->coupled ? (const double (*)[VI_MODES])model->coupling : NULL)
                               : 0.0;
}

void vi_structure_drive(const vi_structure *s, const double force[], double angular_frequency)
{
    vi_structure_state *state = s->state;
    const vi_phase *further = vi_structure_further(s);
    vi_instant *past[VI_PORTS + 4] = {&state->held_since, &state->input_since, &state->standstill.instant,
                                      &state->budget.mark};
    for (int k = 0; k < VI_PORTS; ++k) {
        past[4 + k] = &state->separated[k];
    }
    vi_clock_retune(&s->model->clock, angular_frequency, &state->now, past, VI_PORTS + 4);
    for (int k = 0; k < vi_structure_sines(s->model); ++k) {
        vi_sine *sine = &s->model->sine[k];
        *sine = vi_sine_from(&s->model->clock, sine->angular_frequency, state->now, further[k].angle);
    }
    state->harmonics.first = INT64_MAX;
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        vi_mode_drive(&s->model->mode[j], force[j], angular_frequency);
        state->origin[j].known = 0;
    }
    state->rest.known = 0;
    state->budget.unfinished = 0;
    vi_structure_prepare(s->model);
}

void vi_structure_drive_further(const vi_structure *s, int sines, double (*force)[VI_MODES],
                                const double angular_frequency[], const double phase[])
{
    vi_structure_model *model = s->model;
    vi_structure_state *state = s->state;
    for (int k = 0; k < sines && VI_SINES > 0; ++k) {
        model->sine[k] = phase != NULL
                             ? vi_sine_start(&model->clock, angular_frequency[k], phase[k])
                             : vi_sine_from(&model->clock, angular_frequency[k], state->now, state->further[k].angle);
    }
    model->sines = sines;
    state->further_at.periods = state->harmonics.first = INT64_MAX; /* no phase is known */
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        double of_mode[VI_SINES_ROOM];
        for (int k = 0; k < sines && VI_SINES > 0; ++k) {
            of_mode[k] = j < vi_structure_free_modes(model) ? force[k][j] : 0.0;
        }
        vi_mode_drive_further(&model->mode[j], sines, of_mode, angular_frequency);
        state->origin[j].known = 0;
    }
    state->rest.known = 0;
    state->budget.unfinished = 0;
    vi_structure_prepare(model);
}

/* ---- the present instant ---- */

const vi_phase *vi_structure_further(const vi_structure *s)
{
    vi_structure_state *state = s->state;
    const vi_instant at = state->further_at, now = state->now;
    if (vi_structure_sines(s->model) > 0
        && !(at.periods == now.periods && at.rest == now.rest && at.rest_low == now.rest_low)) {
        vi_sine_phases(s->model->sine, vi_structure_sines(s->model), &s->model->clock, now, vi_structure_phase(s),
                       &state->harmonics, state->further);
        state->further_at = now;
    }
    return state->further;
}

vi_drive vi_structure_drive_now(const vi_structure *s, double held[])
{
    const vi_structure_state *state = s->state;
    vi_structure_held_now(s, held);
    return (vi_drive){.phase = vi_structure_phase(s),
                      .further = vi_structure_further(s),
                      .held = held,
                      .held_rate = state->held_rate,
                      .degree = vi_structure_degree(s),
                      .higher = state->higher};
}

vi_phase vi_structure_phase(const vi_structure *s)
{
    const double angle = s->model->clock.angular_frequency * s->state->now.rest;
    if (angle != s->state->phase.angle) {
        s->state->phase = vi_phase_of(angle);
    }
    return s->state->phase;
}

void vi_structure_phase_is(const vi_structure *s, vi_phase phase)
{
    const double angle = s->model->clock.angular_frequency * s->state->now.rest;
    if (angle != 0.0) { /* a period begins exactly at phase 0 */
        s->state->phase = (vi_phase){angle, phase.cosine, phase.sine};
    }
}

void vi_structure_held_now(const vi_structure *s, double held[])
{
    const vi_structure_state *state = s->state;
    bool slopes = false;
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        held[j] = state->held[j];
        slopes = slopes || state->held_rate[j] != 0.0;
    }
    if (!slopes) {
        return;
    }
    const double elapsed = vi_clock_elapsed(&s->model->clock, state->held_since, state->now);
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        held[j] += state->held_rate[j] * elapsed;
    }
}

double vi_structure_clearance(const vi_structure *s, int k)
{
    const int32_t status = s->state->status[k];
    const bool begins = status == VI_CONTACT_YIELDING && s->state->leaving[k];
    if (status == VI_CONTACT_TOUCHING || status == VI_CONTACT_HELD || begins) {
        return 0.0;
    }
    const double displacement = vi_structure_at(s->model, s->model->shape[k], s->state->q);
    return vi_structure_direction(s, k) * (s->contacts[k].position - displacement);
}

/* Does contact k meet a stop that answers only with impulses? */
static bool is_rigid(const vi_structure *s, int k)
{
    return vi_structure_watched(s, k) && s->model->stop[k] == VI_RIGID_STOP;
}

double vi_structure_within(const vi_structure *s, double displacement)
{
    for (int k = 0; k < s->model->contacts; ++k) {
        const double sign = vi_structure_direction(s, k), stop = s->contacts[k].position;
        if (s->model->at_observed[k] && sign * displacement > sign * stop && is_rigid(s, k)
            && !vi_structure_stop_moves(s->model, k)) {
            displacement = stop;
        }
    }
    return displacement;
}

double vi_structure_observed(const vi_structure *s)
{
    for (int k = 0; k < s->model->contacts; ++k) {
        const int32_t status = s->state->status[k];
        if (s->model->at_observed[k] && (status == VI_CONTACT_TOUCHING || status == VI_CONTACT_HELD)) {
            return vi_structure_stop_position(s, k);
        }
    }
    return vi_structure_within(s, vi_structure_at(s->model, s->model->observed, s->state->q));
}

static double size_at(const vi_structure_model *model, const double shape[], const double vector[])
{
    double sum = 0.0;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        sum += fabs(shape[j] * vector[j]);
    }
    return sum;
}

double vi_structure_displacement_size(const vi_structure *s, int k)
{
    return fabs(s->contacts[k].position) + size_at(s->model, s->model->shape[k], s->state->q);
}

double vi_structure_velocity_size(const vi_structure *s, int k)
{
    const vi_structure_model *model = s->model;
    double sum = 0.0;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const vi_mode *mode = &model->mode[j];
        const double loads = mode->force_size + fabs(s->state->held[j]);
        sum += fabs(model->shape[k][j])
               * (fabs(s->state->p[j]) + mode->natural * fabs(s->state->q[j]) + loads * model->radian);
    }
    return sum;
}

double vi_structure_most_acceleration(const vi_structure *s, int k)
{
    for (int l = 0; l < s->model->contacts; ++l) {
        if (s->state->status[l] >= VI_CONTACT_HELD) {
            return HUGE_VAL;
        }
    }
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        if (s->state->held_rate[j] != 0.0) {
            return HUGE_VAL;
        }
    }
    return s->model->coupled || vi_structure_degree(s) > 1 ? HUGE_VAL : s->model->fastest * vi_structure_velocity_size(s, k);
}

double vi_structure_kinetic(const vi_structure *s)
{
    return 0.5 * vi_structure_at_body(s->model, s->state->p, s->state->p);
}

int vi_structure_beyond(const vi_structure *s)
{
    for (int k = 0; k < s->model->contacts; ++k) {
        const double noise = VI_ROUNDING * vi_structure_displacement_size(s, k);
        if (vi_contact_law_is_rigid(s->contacts[k].law.law) && vi_structure_clearance(s, k) < -noise) {
            return k + 1;
        }
    }
    return 0;
}

void vi_structure_complain(const vi_structure *s, char message[VI_MESSAGE_LENGTH])
{
    int on_stop[VI_PORTS];
    for (int k = 0; k < s->model->contacts; ++k) {
        on_stop[k] = s->state->status[k] != VI_CONTACT_FREE;
    }
    vi_complain_of_standstill(message, vi_clock_time(&s->model->clock, s->state->now), on_stop, s->model->contacts);
}

/* ---- inputs ---- */

void vi_structure_hold(const vi_structure *s, const double held[], const double held_rate[])
{
    vi_structure_state *state = s->state;
    memcpy(state->held, held, (size_t)vi_structure_modes(s->model) * sizeof held[0]);
    memcpy(state->held_rate, held_rate, (size_t)vi_structure_modes(s->model) * sizeof held_rate[0]);
    if (state->exchange.on) { /* the importer gives inputs at each instant: there is no step with slopes */
        memset(state->held_rate, 0, sizeof state->held_rate);
    }
    state->held_since = state->input_since = state->now;
    state->budget.unfinished = 0;
    for (int k = 0; k < s->model->contacts; ++k) {
        const vi_contact *contact = &s->contacts[k];
        if (s->model->stop[k] == VI_YIELDING_STOP && vi_contact_law_is_external(contact->law.law)) {
            state->reference_penetration[k] = -vi_structure_clearance(s, k);
            state->reference_rate[k] = vi_structure_approach(s, k);
            continue;
        }
        const double push = vi_structure_direction(s, k) * contact->applied_force;
        for (int j = 0; j < vi_structure_free_modes(s->model) && push != 0.0; ++j) {
            state->held[j] -= s->model->shape[k][j] * push;
        }
    }
    if (VI_SIGNALS > 0) {
        memcpy(state->input, state->held, sizeof state->input);
        memcpy(state->input_rate, state->held_rate, sizeof state->input_rate);
    }
}
