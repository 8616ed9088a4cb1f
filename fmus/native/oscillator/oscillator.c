#include "oscillator.h"

#include <math.h>

#include "oscillator_variables.h"

static void defaults(void *self)
{
    oscillator *o = self;
    o->mass = o->stiffness = 1.0;
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

static void check_inputs(const void *self, char message[VI_MESSAGE_LENGTH])
{
    const oscillator *o = self;
    vi_check_finite(message, "force", o->force);
    vi_check_finite(message, "force_rate", o->force_rate);
}

static void check_forcing(const void *self, char message[VI_MESSAGE_LENGTH])
{
    const oscillator *o = self;
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

/* Modal amplitude of the harmonic force and of the base's inertial force; a force of frequency 0 is constant. */
static void find_forcing(const void *self, double force[VI_MODES])
{
    const oscillator *o = self;
    const double amplitude = o->forcing_amplitude - o->mass * o->forcing_base_acceleration;
    const double share = o->body.forcing_angular_frequency == 0.0 ? cos(o->body.forcing_phase) : 1.0;
    force[0] = amplitude * share / sqrt(o->mass);
}

/* Set the mode for this dashpot and spring. */
static void fill_mode(oscillator *o, double damping, double stiffness)
{
    vi_mode *mode = &o->body.model.mode[0];
    double force[VI_MODES];
    find_forcing(o, force);
    vi_mode_start(mode, o->mass, damping, stiffness, 0.0, 0.0);
    vi_mode_drive(mode, force[0], o->body.forcing_angular_frequency);
}

static bool prepare(void *self, char message[VI_MESSAGE_LENGTH])
{
    oscillator *o = self;
    if (!parameters_are_good(o, message)) {
        return false;
    }
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
    return true;
}

/* Adapt spring and dashpot to the present amplitude, until the next step, if they depend on it. */
static void follow_amplitude(void *self)
{
    oscillator *o = self;
    if (!vi_amplitude_acts(&o->amplitude)) {
        return;
    }
    const double root = sqrt(o->mass), natural = sqrt(o->stiffness / o->mass);
    const double a = vi_amplitude_of(o->body.state.q[0] / root, o->body.state.p[0] / root, natural);
    const double now = vi_amplitude_natural(&o->amplitude, natural, a);
    const double ratio = vi_amplitude_ratio(&o->amplitude, 0.5 * o->damping / (root * sqrt(o->stiffness)), a);
    /* the ratio refers to the frequency of small motion: a stiffer spring keeps the dashpot */
    fill_mode(o, 2.0 * ratio * natural * o->mass, now * now * o->mass);
    vi_structure_prepare(&o->body.model);
}

/* ---- loads and outputs ---- */

static void find_inputs(const void *self, double held[VI_MODES], double held_rate[VI_MODES])
{
    const oscillator *o = self;
    const double root = sqrt(o->mass);
    held[0] = o->force / root - root * o->body.base_acceleration;
    held_rate[0] = o->force_rate / root - root * o->body.base_acceleration_rate;
}

static double base_forcing(const void *self)
{
    return ((const oscillator *)self)->forcing_base_acceleration;
}

static void update_outputs(void *self, double base_acceleration)
{
    oscillator *o = self;
    (void)base_acceleration;
    o->relative_acceleration = vi_structure_at(&o->body.model, o->body.model.observed, o->body.modal_acceleration);
}

static void show_states(void *self, vi_exchange_body *body)
{
    const oscillator *o = self;
    body->modes = 1;
    body->scale = sqrt(o->mass);
    body->refused = vi_amplitude_acts(&o->amplitude) ? "amplitude" : NULL;
}

/* ---- partial derivatives ---- */

static bool column(void *self, size_t offset, vi_line *line)
{
    const oscillator *o = self;
    const double root = sqrt(o->mass);
    vi_body_line_of_mode(&o->body, line, 0, 1.0);
    switch (offset) {
    case offsetof(oscillator, force): line->load = 1.0 / root; return true;
    case offsetof(oscillator, force_rate): return true;
    case offsetof(oscillator, body.base_acceleration): line->load = -root; return true;
    case offsetof(oscillator, forcing_amplitude): line->load = vi_body_cosine_of_forcing(&o->body) / root; return true;
    case offsetof(oscillator, forcing_base_acceleration):
        line->base = vi_body_cosine_of_forcing(&o->body);
        line->load = -root * line->base;
        return true;
    default: return false;
    }
}

static bool row(void *self, size_t offset, vi_line *line)
{
    const oscillator *o = self;
    if (offset != offsetof(oscillator, relative_acceleration)) {
        return false;
    }
    vi_body_line_of_shape(&o->body, line, o->body.model.observed);
    line->load = 1.0;
    return true;
}

/* ---- derivatives since the start ---- */

VI_RARE static bool parameter(void *self, size_t offset, vi_parameter *parameter, vi_sensitivity *of)
{
    const oscillator *o = self;
    const double root = sqrt(o->mass);
    parameter->row[0] = 1.0 / root;
    switch (offset) {
    case offsetof(oscillator, mass): parameter->mass = 1.0; return true;
    case offsetof(oscillator, damping): parameter->damping = 1.0; return true;
    case offsetof(oscillator, stiffness): parameter->stiffness = 1.0; return true;
    case offsetof(oscillator, displacement_start): of->q[0] = root; return true;
    case offsetof(oscillator, velocity_start): of->p[0] = root; return true;
    case offsetof(oscillator, forcing_amplitude):
    case offsetof(oscillator, forcing_base_acceleration): return vi_body_forcing_slopes(self, offset, parameter);
    default: return false;
    }
}

const vi_body_form vi_this_body = {
    .place = offsetof(oscillator, body),
    .restitution = OSCILLATOR_CONTACT_APPLIED_RESTITUTION_1,
    .stride = OSCILLATOR_CONTACT_APPLIED_RESTITUTION_2 - OSCILLATOR_CONTACT_APPLIED_RESTITUTION_1,
    .taken = OSCILLATOR_RECORD_TAKEN,
    .start = "displacement_start",
    .defaults = defaults,
    .prepare = prepare,
    .check_inputs = check_inputs,
    .check_forcing = check_forcing,
    .find_forcing = find_forcing,
    .find_inputs = find_inputs,
    .follow_amplitudes = follow_amplitude,
    .base_forcing = base_forcing,
    .update_outputs = update_outputs,
    .show_states = show_states,
    .column = column,
    .row = row,
    .parameter = parameter,
};
