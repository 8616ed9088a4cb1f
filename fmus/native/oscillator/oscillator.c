#include "oscillator.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "component.h"
#include "impact.h"
#include "oscillator_variables.h"

/* An importer's communication point may differ from the oscillator's own time by this times (1 + |time|), s. */
static const double TIME_MISMATCH = 1e-9;

static void defaults(void *self)
{
    oscillator *o = self;
    o->mass = o->stiffness = 1.0;
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        vi_contact *contact = &o->body.contacts[k];
        contact->side = VI_SIDE_UPPER;
        contact->law.restitution = 1.0;
        contact->last_time = contact->last_phase = contact->stick_start = contact->stick_end = NAN;
        contact->event_time = NAN;
    }
}

/* ---- validation: every problem is named, in one message ---- */

static void complain(char message[VI_MESSAGE_LENGTH], const char *format, ...)
{
    const size_t used = strlen(message);
    va_list arguments;
    va_start(arguments, format);
    if (used == 0) {
        (void)vsnprintf(message, VI_MESSAGE_LENGTH, format, arguments);
    } else if (used + 3 < VI_MESSAGE_LENGTH) {
        memcpy(message + used, "; ", 3);
        (void)vsnprintf(message + used + 2, VI_MESSAGE_LENGTH - used - 2, format, arguments);
    }
    va_end(arguments);
}

static void check_positive(char *message, const char *name, double value)
{
    if (!(value > 0.0) || !isfinite(value)) {
        complain(message, "%s: expected a finite number > 0, got %.17g", name, value);
    }
}

static void check_not_negative(char *message, const char *name, double value)
{
    if (!(value >= 0.0) || !isfinite(value)) {
        complain(message, "%s: expected a finite number >= 0, got %.17g", name, value);
    }
}

static void check_finite(char *message, const char *name, double value)
{
    if (!isfinite(value)) {
        complain(message, "%s: expected a finite number, got %.17g", name, value);
    }
}

static void check_contact(char *message, const oscillator *o, int k)
{
    const vi_contact *contact = &o->body.contacts[k];
    const int n = k + 1;
    if (contact->law.law == VI_LAW_NONE) {
        return;
    }
    if (!vi_contact_law_known(contact->law.law) && contact->law.law != VI_LAW_EXTERNAL) {
        complain(message, "contact[%d].law: expected 0 (none), 1 (restitution) or 5 (external), got %lld", n,
                 (long long)contact->law.law);
    }
    if (contact->side != VI_SIDE_UPPER && contact->side != VI_SIDE_LOWER) {
        complain(message, "contact[%d].side: expected 1 (upper) or 2 (lower), got %lld", n, (long long)contact->side);
    }
    if (!(contact->law.restitution >= 0.0 && contact->law.restitution <= 1.0)) {
        complain(message, "contact[%d].restitution: expected 0 <= r <= 1, got %.17g", n, contact->law.restitution);
    }
    if (!isfinite(contact->position)) {
        complain(message, "contact[%d].position: expected a finite number, got %.17g", n, contact->position);
        return;
    }
    const double sign = vi_contact_direction(contact->side);
    if (sign * (o->displacement_start - contact->position) > 0.0) {
        complain(message, "displacement_start: expected a start on the free side of contact[%d] (%s %.17g), got %.17g",
                 n, sign > 0.0 ? "<=" : ">=", contact->position, o->displacement_start);
    }
}

/* Two stops on opposite sides must leave room to move. */
static void check_gap(char *message, const oscillator *o)
{
    const vi_contact *a = &o->body.contacts[0], *b = &o->body.contacts[1];
    if (a->law.law == VI_LAW_NONE || b->law.law == VI_LAW_NONE || a->side == b->side) {
        return;
    }
    const double sign = vi_contact_direction(a->side);
    if (!(sign * (a->position - b->position) > 0.0)) {
        complain(message, "contact[2].position: expected room between the stops, got %.17g and %.17g", a->position,
                 b->position);
    }
}

static void check_inputs(char *message, const oscillator *o)
{
    check_finite(message, "force", o->force);
    check_finite(message, "force_rate", o->force_rate);
    check_finite(message, "base_acceleration", o->base_acceleration);
    check_finite(message, "base_acceleration_rate", o->base_acceleration_rate);
    check_finite(message, "contact[1].applied_force", o->body.contacts[0].applied_force);
    check_finite(message, "contact[2].applied_force", o->body.contacts[1].applied_force);
}

static bool parameters_are_good(const oscillator *o, char *message)
{
    check_positive(message, "mass", o->mass);
    check_not_negative(message, "damping", o->damping);
    check_not_negative(message, "stiffness", o->stiffness);
    check_finite(message, "forcing.amplitude", o->forcing_amplitude);
    check_not_negative(message, "forcing.angular_frequency", o->forcing_angular_frequency);
    check_finite(message, "forcing.phase", o->forcing_phase);
    check_finite(message, "displacement_start", o->displacement_start);
    check_finite(message, "velocity_start", o->velocity_start);
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        check_contact(message, o, k);
    }
    check_gap(message, o);
    check_inputs(message, o);
    if (o->body.impact_limit < 0) {
        complain(message, "impact_limit: expected >= 0, got %lld", (long long)o->body.impact_limit);
    }
    return message[0] == '\0';
}

/* ---- life ---- */

static void hold_inputs(oscillator *o)
{
    vi_body_hold(&o->body, o->force / o->mass - o->base_acceleration,
                 o->force_rate / o->mass - o->base_acceleration_rate);
    o->inputs_changed = 0;
}

static void was_set(void *self, uint32_t value_reference)
{
    oscillator *o = self;
    o->inputs_changed = 1;
    if (value_reference == OSCILLATOR_CONTACT_APPLIED_RESTITUTION_1) {
        o->body.contacts[0].answered = 1;
    } else if (value_reference == OSCILLATOR_CONTACT_APPLIED_RESTITUTION_2) {
        o->body.contacts[1].answered = 1;
    } else if (value_reference == OSCILLATOR_RECORD_TAKEN) {
        vi_record_take(&o->body.record);
    }
}

static void start_mode(oscillator *o)
{
    const bool constant = o->forcing_angular_frequency == 0.0;
    const double amplitude = constant ? o->forcing_amplitude * cos(o->forcing_phase) : o->forcing_amplitude;
    vi_mode_start(&o->body.mode, o->mass, o->damping, o->stiffness, amplitude, o->forcing_angular_frequency);
    o->body.mass = o->mass;
}

static void update_outputs(void *self)
{
    oscillator *o = self;
    o->time = vi_clock_time(&o->body.clock, o->body.now);
    if (o->inputs_changed) {
        hold_inputs(o);
    }
    const double relative = vi_body_outputs(&o->body);
    o->displacement = o->body.displacement;
    o->velocity = o->body.velocity;
    o->acceleration = relative + o->base_acceleration;
    o->energy_kinetic = 0.5 * o->mass * o->velocity * o->velocity;
    o->energy_potential = 0.5 * o->stiffness * o->displacement * o->displacement;
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    oscillator *o = self;
    message[0] = '\0';
    if (!parameters_are_good(o, message)) {
        return false;
    }
    start_mode(o);
    vi_instant now;
    if (!vi_clock_start(&o->body.clock, o->forcing_angular_frequency, o->forcing_phase, o->body.mode.natural)
        || !isfinite(start_time) || !vi_clock_instant(&o->body.clock, start_time, 0.0, &now)) {
        complain(message, "forcing.angular_frequency: expected a period between 1e-300 and 1e300 s that a start time of"
                          " %.17g s can be counted in, got %.17g rad/s",
                 start_time, o->forcing_angular_frequency);
        return false;
    }
    vi_body_start(&o->body, now, o->displacement_start, o->velocity_start);
    hold_inputs(o);
    update_outputs(o);
    return true;
}

static bool step_is_good(const oscillator *o, const vi_step_request *request, vi_instant *target, char *message)
{
    message[0] = '\0';
    if (!(request->size > 0.0) || !isfinite(request->size)) {
        complain(message, "communicationStepSize: expected a finite number > 0, got %.17g", request->size);
    }
    const double now = vi_clock_time(&o->body.clock, o->body.now);
    if (!(fabs(request->time - now) <= TIME_MISMATCH * (1.0 + fabs(now)))) {
        complain(message, "currentCommunicationPoint: expected %.17g (the end of the last step), got %.17g", now,
                 request->time);
    }
    const double high = request->time + request->size;
    const double part = high - request->time;
    const double low = (request->time - (high - part)) + (request->size - part);
    if (message[0] == '\0' && !vi_clock_instant(&o->body.clock, high, low, target)) {
        complain(message, "currentCommunicationPoint: expected a time below 2^53 forcing periods, got %.17g", high);
    }
    check_inputs(message, o);
    if (o->body.passed) {
        complain(message, "contact[%d]: the last step passed through a stop whose law is external (event_time %.17g);"
                          " restore the state before it and step to event_time", (int)o->body.passed,
                 o->body.contacts[o->body.passed - 1].event_time);
    }
    return message[0] == '\0';
}

static bool resolve(void *self, char message[VI_MESSAGE_LENGTH])
{
    oscillator *o = self;
    message[0] = '\0';
    if (!o->body.pending) {
        return true;
    }
    const vi_contact *contact = &o->body.contacts[o->body.pending - 1];
    const double r = contact->applied_restitution;
    if (!contact->answered || !(r >= 0.0 && r <= 1.0)) {
        complain(message, "contact[%d].applied_restitution: expected an answer 0 <= r <= 1 to the contact at %.17g s,"
                          " got %s%.17g", (int)o->body.pending, contact->event_time,
                 contact->answered ? "" : "none; last value ", r);
        return false;
    }
    vi_body_resolve(&o->body);
    update_outputs(o);
    return true;
}

static vi_step_result step(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    oscillator *o = self;
    vi_instant target;
    if (!step_is_good(o, request, &target, message) || !resolve(o, message)) {
        return VI_STEP_ERROR;
    }
    hold_inputs(o);
    const vi_step_result result = vi_body_advance(&o->body, target, request);
    update_outputs(o);
    return result;
}

static bool event_pending(const void *self)
{
    return ((const oscillator *)self)->body.pending != 0;
}

static bool needs_events(const void *self)
{
    const oscillator *o = self;
    return o->body.contacts[0].law.law == VI_LAW_EXTERNAL || o->body.contacts[1].law.law == VI_LAW_EXTERNAL;
}

static double present_time(const void *self)
{
    const oscillator *o = self;
    return vi_clock_time(&o->body.clock, o->body.now);
}

static size_t used_size(const void *self)
{
    return sizeof(oscillator) - vi_record_unused(&((const oscillator *)self)->body.record);
}

const vi_component vi_this_component = {
    .name = OSCILLATOR_NAME,
    .token = OSCILLATOR_TOKEN,
    .variables = oscillator_variables,
    .variable_count = OSCILLATOR_VARIABLE_COUNT,
    .struct_size = sizeof(oscillator),
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
};
