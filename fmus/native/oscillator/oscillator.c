#include "oscillator.h"

#include <math.h>

#include "component.h"
#include "oscillator_variables.h"

enum { STRIDE = OSCILLATOR_CONTACT_APPLIED_RESTITUTION_2 - OSCILLATOR_CONTACT_APPLIED_RESTITUTION_1 };

static void defaults(void *self)
{
    oscillator *o = self;
    o->mass = o->stiffness = 1.0;
    vi_body_defaults(&o->body);
}

static void sized(void *self, const char *block, int count)
{
    vi_body_sized(&((oscillator *)self)->body, block, count);
}

/* ---- validation ---- */

static void check_amplitude(const oscillator *o, char *message)
{
    vi_check_finite(message, "amplitude.frequency_slope", o->amplitude.frequency_slope);
    vi_check_finite(message, "amplitude.damping_slope", o->amplitude.damping_slope);
    vi_check_not_negative(message, "amplitude.damping_reciprocal", o->amplitude.damping_reciprocal);
    if (vi_amplitude_acts(&o->amplitude) && o->stiffness == 0.0) {
        vi_complain(message, "amplitude: expected a stiffness > 0 beside it, got 0; without a spring there is no"
                             " natural frequency to change");
    }
}

static void check_inputs(const oscillator *o, char *message)
{
    vi_check_finite(message, "force", o->force);
    vi_check_finite(message, "force_rate", o->force_rate);
}

static void check_forcing(const oscillator *o, char *message)
{
    vi_check_finite(message, "forcing.amplitude", o->forcing_amplitude);
    vi_check_finite(message, "forcing.base_acceleration", o->forcing_base_acceleration);
}

static bool parameters_are_good(const oscillator *o, char *message)
{
    vi_check_positive(message, "mass", o->mass);
    vi_check_not_negative(message, "damping", o->damping);
    vi_check_not_negative(message, "stiffness", o->stiffness);
    check_amplitude(o, message);
    check_forcing(o, message);
    vi_check_finite(message, "displacement_start", o->displacement_start);
    vi_check_finite(message, "velocity_start", o->velocity_start);
    vi_body_check(&o->body, message);
    check_inputs(o, message);
    return message[0] == '\0';
}

/* ---- from parameters to the mode: mass-normalised, q = sqrt(mass) x ---- */

/* Modal amplitude of the harmonic force and of the base's inertial one; a force of frequency 0 is constant. */
static double modal_force(const oscillator *o)
{
    const double amplitude = o->forcing_amplitude - o->mass * o->forcing_base_acceleration;
    const double share = o->body.forcing_angular_frequency == 0.0 ? cos(o->body.forcing_phase) : 1.0;
    return amplitude * share / sqrt(o->mass);
}

/* The mode with this dashpot and spring. */
static void fill_mode(oscillator *o, double damping, double stiffness)
{
    vi_mode *mode = &o->body.model.mode[0];
    vi_mode_start(mode, o->mass, damping, stiffness, 0.0, 0.0);
    vi_mode_drive(mode, modal_force(o), o->body.forcing_angular_frequency);
}

static void fill_model(oscillator *o)
{
    vi_structure_model *model = &o->body.model;
    const double root = sqrt(o->mass);
    model->modes = 1;
    model->contacts = vi_body_ports(&o->body);
    model->varies = vi_amplitude_acts(&o->amplitude);
    fill_mode(o, o->damping, o->stiffness);
    o->body.natural[0] = model->mode[0].natural;
    for (int k = 0; k < VI_PORTS; ++k) {
        model->shape[k][0] = model->impulse[k][0] = 1.0 / root;
    }
    model->observed[0] = 1.0 / root;
    o->body.state.q[0] = root * o->displacement_start;
    o->body.state.p[0] = root * o->velocity_start;
}

/* Spring and dashpot as they are at the present amplitude, until the next step; nothing where they do not depend on it. */
static void follow_amplitude(oscillator *o)
{
    if (!vi_amplitude_acts(&o->amplitude)) {
        return;
    }
    const double root = sqrt(o->mass), natural = sqrt(o->stiffness / o->mass);
    const double a = vi_amplitude_of(o->body.state.q[0] / root, o->body.state.p[0] / root, natural);
    const double now = vi_amplitude_natural(&o->amplitude, natural, a);
    const double ratio = vi_amplitude_ratio(&o->amplitude, 0.5 * o->damping / (root * sqrt(o->stiffness)), a);
    /* the ratio is to the frequency of small motion: the spring does not stiffen the dashpot */
    fill_mode(o, 2.0 * ratio * natural * o->mass, now * now * o->mass);
    vi_structure_prepare(&o->body.model);
}

/* As an importer integrates it. */
static vi_exchange_body exchange_body(oscillator *o)
{
    vi_exchange_body body = vi_body_exchange(&o->body);
    body.modes = 1;
    body.scale = sqrt(o->mass);
    body.refused = vi_amplitude_acts(&o->amplitude) ? "amplitude" : body.refused;
    return body;
}

/* ---- life ---- */

static void hold_inputs(oscillator *o)
{
    const double root = sqrt(o->mass);
    const double held[VI_MODES] = {o->force / root - root * o->body.base_acceleration};
    const double held_rate[VI_MODES] = {o->force_rate / root - root * o->body.base_acceleration_rate};
    vi_body_hold(&o->body, held, held_rate);
}

static void drive(oscillator *o)
{
    if (o->body.forcing_changed) {
        const double force[VI_MODES] = {modal_force(o)};
        vi_body_drive(&o->body, force);
    }
}

static void refresh_inputs(oscillator *o)
{
    drive(o);
    if (o->body.inputs_changed) {
        vi_body_take_impulses(&o->body);
        hold_inputs(o);
    }
}

static void update_outputs(void *self)
{
    oscillator *o = self;
    refresh_inputs(o);
    o->time = vi_body_time(&o->body);
    vi_body_outputs(
        &o->body, vi_body_base_acceleration(&o->body, o->forcing_base_acceleration));
    o->relative_acceleration = vi_structure_at(&o->body.model, o->body.model.observed, o->body.modal_acceleration);
    if (o->body.state.exchange.on) {
        const vi_exchange_body body = exchange_body(o);
        vi_exchange_show_indicators(&body);
    }
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    oscillator *o = self;
    if (!parameters_are_good(o, message)) {
        return false;
    }
    fill_model(o);
    if (!vi_body_start(&o->body, start_time, "displacement_start", message)) {
        return false;
    }
    hold_inputs(o);
    update_outputs(o);
    return true;
}

static void was_set(void *self, uint32_t reference)
{
    oscillator *o = self;
    if (reference == OSCILLATOR_FORCING_AMPLITUDE || reference == OSCILLATOR_FORCING_BASE_ACCELERATION
        || reference == OSCILLATOR_FORCING_ANGULAR_FREQUENCY) {
        o->body.forcing_changed = 1;
    }
    vi_body_was_set(&o->body, reference, OSCILLATOR_CONTACT_APPLIED_RESTITUTION_1, STRIDE,
                                   OSCILLATOR_RECORD_TAKEN);
}

static bool resolve(void *self, char message[VI_MESSAGE_LENGTH])
{
    oscillator *o = self;
    if (!vi_body_resolve(&o->body, message)) {
        return false;
    }
    update_outputs(o);
    return true;
}

/* Of a tuned forcing that the body has not gone on with. */
static void check_drive(const oscillator *o, char *message)
{
    if (o->body.forcing_changed) {
        check_forcing(o, message);
        vi_body_check_drive(&o->body, message);
    }
}

static vi_step_result step(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    oscillator *o = self;
    vi_instant target;
    drive(o);
    check_inputs(o, message);
    check_drive(o, message);
    if (!vi_body_step_is_good(&o->body, request, &target, message)
        || !vi_body_resolve(&o->body, message)) {
        return VI_STEP_ERROR;
    }
    if (!vi_body_continues(&o->body)) {
        vi_body_take_impulses(&o->body);
        follow_amplitude(o);
        hold_inputs(o);
    }
    const vi_step_result result = vi_body_advance(&o->body, target, request, message);
    update_outputs(o);
    return result;
}

static bool event_pending(const void *self)
{
    return ((const oscillator *)self)->body.state.pending != 0;
}

static bool needs_events(const void *self)
{
    return vi_body_needs_events(&((const oscillator *)self)->body);
}

static double present_time(const void *self)
{
    return vi_body_time(&((const oscillator *)self)->body);
}

static size_t used_size(const void *self)
{
    return sizeof(oscillator) - vi_body_unused(&((const oscillator *)self)->body);
}

VI_EXCHANGE_TABLE(exchange, exchange_body, refresh_inputs);

const vi_component vi_this_component = {
    .defaults = defaults,
    .initialize = initialize,
    .was_set = was_set,
    .update_outputs = update_outputs,
    .step = step,
    .resolve = resolve,
    .event_pending = event_pending,
    .needs_events = needs_events,
    .time = present_time,
    .used_size = used_size,
    .sized = sized,
    .exchange = &exchange,
};
