#include "engine.h"

#include <math.h>

#include "body/modal/structure_impact.h"

bool oscillator_yields(const oscillator *o)
{
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        const int64_t law = o->body.contacts[k].law.law;
        if (vi_contact_law_is_compliant(law) || law == VI_LAW_EXTERNAL_FORCE) {
            return true;
        }
    }
    return o->state.exchange.on != 0;
}

/* The parts of the one-mode body. */
static vi_structure parts(oscillator *o)
{
    return (vi_structure){&o->model, &o->state, o->body.contacts, &o->body.record, &o->pressed};
}

vi_exchange_body oscillator_exchange(oscillator *o)
{
    return (vi_exchange_body){.parts = parts(o),
                              .modes = 1,
                              .contacts = o->contacts_described,
                              .scale = sqrt(o->mass),
                              .refused = vi_amplitude_acts(&o->amplitude) ? "amplitude" : NULL};
}

/* A force of frequency 0 is constant. */
static double amplitude(const oscillator *o)
{
    const bool constant = o->forcing_angular_frequency == 0.0;
    return constant ? o->forcing_amplitude * cos(o->forcing_phase) : o->forcing_amplitude;
}

bool oscillator_start_clock(oscillator *o, double start_time, vi_instant *now)
{
    const double natural = sqrt(o->stiffness / o->mass);
    const bool started = vi_clock_start(&o->body.clock, o->forcing_angular_frequency, o->forcing_phase, natural)
                         && isfinite(start_time) && vi_clock_instant(&o->body.clock, start_time, 0.0, now);
    o->model.clock = o->body.clock;
    return started;
}

static void start_body(oscillator *o, vi_instant now)
{
    vi_mode_start(&o->body.mode, o->mass, o->damping, o->stiffness, amplitude(o), o->forcing_angular_frequency);
    o->body.mass = o->mass;
    vi_body_start(&o->body, now, o->displacement_start, o->velocity_start);
}

/* One mode, mass-normalised: q = sqrt(mass) x. A dashpot without a spring is no damping ratio: the engine takes it as
 * damping that "couples" the one mode with itself. */
static void start_structure(oscillator *o, vi_instant now)
{
    vi_structure_model *model = &o->model;
    const double root = sqrt(o->mass), natural = sqrt(o->stiffness / o->mass);
    model->modes = 1;
    model->contacts = VI_BODY_CONTACTS;
    model->impact_limit = o->body.impact_limit;
    model->tolerance = o->contact_tolerance;
    model->varies = vi_amplitude_acts(&o->amplitude);
    const double ratio = natural > 0.0 ? 0.5 * o->damping / (root * sqrt(o->stiffness)) : 0.0;
    vi_structure_mode(model, 0, natural, ratio, amplitude(o) / root, o->forcing_angular_frequency);
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        model->shape[k][0] = model->impulse[k][0] = 1.0 / root;
    }
    model->observed[0] = 1.0 / root;
    model->coupled = natural == 0.0 && o->damping > 0.0;
    model->coupling[0][0] = o->damping / o->mass;
    vi_structure_prepare(model);
    o->state.q[0] = root * o->displacement_start;
    o->state.p[0] = root * o->velocity_start;
    const vi_structure s = parts(o);
    vi_structure_start(&s, now);
}

void oscillator_start(oscillator *o, vi_instant now)
{
    o->yields = oscillator_yields(o);
    if (o->yields) {
        start_structure(o, now);
    } else {
        start_body(o, now);
    }
}

void oscillator_drive(oscillator *o)
{
    const bool possible = isfinite(o->forcing_amplitude)
                          && vi_clock_can_retune(&o->body.clock, o->forcing_angular_frequency, oscillator_now(o));
    if (!o->forcing_changed || !possible) {
        return;
    }
    if (o->yields) {
        const double force[VI_MODES] = {amplitude(o) / sqrt(o->mass)};
        const vi_structure s = parts(o);
        vi_structure_drive(&s, force, o->forcing_angular_frequency);
        o->body.clock = o->model.clock;
    } else {
        vi_body_drive(&o->body, amplitude(o) / o->mass, o->forcing_angular_frequency);
    }
    o->forcing_changed = 0;
}

void oscillator_follow_amplitude(oscillator *o)
{
    if (!vi_amplitude_acts(&o->amplitude)) {
        return;
    }
    const double root = sqrt(o->mass), natural = sqrt(o->stiffness / o->mass);
    const double x = o->yields ? o->state.q[0] / root : o->body.displacement;
    const double v = o->yields ? o->state.p[0] / root : o->body.velocity;
    const double a = vi_amplitude_of(x, v, natural);
    const double now = vi_amplitude_natural(&o->amplitude, natural, a);
    const double ratio = vi_amplitude_ratio(&o->amplitude, 0.5 * o->damping / (root * sqrt(o->stiffness)), a);
    /* the ratio is to the frequency of small motion: the spring does not stiffen the dashpot */
    if (o->yields) {
        vi_structure_mode(&o->model, 0, now, ratio * natural / now, amplitude(o) / root, o->forcing_angular_frequency);
        vi_structure_prepare(&o->model);
    } else {
        vi_mode_start(&o->body.mode, o->mass, 2.0 * ratio * natural * o->mass, now * now * o->mass, amplitude(o),
                      o->forcing_angular_frequency);
    }
}

void oscillator_take_impulses(oscillator *o)
{
    if (o->yields) {
        const vi_structure s = parts(o);
        vi_structure_take_impulses(&s);
    } else {
        vi_body_take_impulses(&o->body);
    }
}

void oscillator_hold(oscillator *o)
{
    if (o->yields) {
        const double root = sqrt(o->mass);
        const double held[VI_MODES] = {o->force / root - root * o->base_acceleration};
        const double held_rate[VI_MODES] = {o->force_rate / root - root * o->base_acceleration_rate};
        const vi_structure s = parts(o);
        vi_structure_hold(&s, held, held_rate);
    } else {
        vi_body_hold(&o->body, o->force / o->mass - o->base_acceleration,
                     o->force_rate / o->mass - o->base_acceleration_rate);
    }
    o->inputs_changed = 0;
}

bool oscillator_continues(const oscillator *o)
{
    return !o->inputs_changed && (o->yields ? o->state.budget.unfinished : o->body.budget.unfinished);
}

vi_step_result oscillator_advance(oscillator *o, vi_instant target, const vi_step_request *request,
                                  char message[VI_MESSAGE_LENGTH])
{
    if (o->yields) {
        const vi_structure s = parts(o);
        const vi_step_result result = vi_structure_advance(&s, target, request);
        if (result == VI_STEP_STANDSTILL) {
            vi_structure_complain(&s, message);
        }
        vi_complain_of_end(message, result, vi_clock_time(&o->body.clock, o->state.now));
        return result;
    }
    const vi_step_result result = vi_body_advance(&o->body, target, request);
    if (result == VI_STEP_STANDSTILL) {
        vi_body_complain(&o->body, message);
    }
    vi_complain_of_end(message, result, vi_clock_time(&o->body.clock, o->body.now));
    return result;
}

void oscillator_resolve(oscillator *o)
{
    if (o->yields) {
        const vi_structure s = parts(o);
        vi_structure_resolve(&s);
    } else {
        vi_body_resolve(&o->body);
    }
}

void oscillator_outputs(oscillator *o, double *displacement, double *velocity, double *acceleration)
{
    if (o->yields) {
        const vi_structure s = parts(o);
        double modal[VI_MODES];
        vi_structure_outputs(&s, modal);
        *displacement = vi_structure_at(&o->model, o->model.observed, o->state.q);
        *velocity = vi_structure_at(&o->model, o->model.observed, o->state.p);
        *acceleration = vi_structure_at(&o->model, o->model.observed, modal);
    } else {
        *acceleration = vi_body_outputs(&o->body);
        *displacement = o->body.displacement;
        *velocity = o->body.velocity;
    }
}

vi_instant oscillator_now(const oscillator *o)
{
    return o->yields ? o->state.now : o->body.now;
}

bool oscillator_asks(const oscillator *o, int k)
{
    return o->yields ? o->state.asking[k] != 0 : o->body.pending == k + 1;
}

int oscillator_pending(const oscillator *o)
{
    return o->yields ? o->state.pending : o->body.pending;
}

int oscillator_passed(const oscillator *o)
{
    return o->yields ? o->state.passed : o->body.passed;
}
