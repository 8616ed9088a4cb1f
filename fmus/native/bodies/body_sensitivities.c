#include "body_sensitivities.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "body.h"
#include "body/modal/carry.h"
#include "body_derivatives.h"

static const vi_body_form *const form = &vi_this_body;

/* An amplitude beside which all others are rounding: a difference of forces over it is their slope. */
static const double HUGE_AMPLITUDE = 0x1p60;

/* ---- outputs that have derivatives ---- */

VI_RARE static size_t offset_of(uint32_t reference)
{
    return vi_this_description.variables[reference].offset;
}

/* Is the variable an output of a contact? Then *k is its index, and *member its place in the contact. */
VI_RARE static bool is_of_contact(size_t offset, int *k, size_t *member)
{
    const size_t within = offset - (form->place + offsetof(vi_body, contacts));
    *k = (int)(within / sizeof(vi_contact));
    *member = within % sizeof(vi_contact);
    return within < sizeof(vi_contact) * VI_PORTS;
}

VI_RARE static bool is_followed(void *self, uint32_t reference)
{
    const vi_variable *variable = &vi_this_description.variables[reference];
    vi_line line;
    int k;
    size_t member;
    if (variable->type != VI_FLOAT64 || variable->count != 1
        || (variable->access != VI_READ_ONLY && variable->access != VI_SET_STATE)) {
        return false;
    }
    if (is_of_contact(variable->offset, &k, &member)) {
        return member == offsetof(vi_contact, displacement) || member == offsetof(vi_contact, velocity)
               || member == offsetof(vi_contact, force) || member == offsetof(vi_contact, last_time)
               || member == offsetof(vi_contact, last_velocity);
    }
    switch (variable->offset - form->place) {
    case offsetof(vi_body, displacement):
    case offsetof(vi_body, velocity):
    case offsetof(vi_body, acceleration): return true;
    default: memset(&line, 0, offsetof(vi_line, own)); return form->row(self, variable->offset, &line);
    }
}

/* ---- parameters ---- */

VI_RARE bool vi_body_forcing_slopes(void *self, size_t offset, vi_parameter *parameter)
{
    double *amplitude = (double *)(void *)((char *)self + offset);
    const double own = *amplitude;
    double without[VI_MODES] = {0.0}, with[VI_MODES] = {0.0};
    *amplitude = 0.0;
    form->find_forcing(self, without);
    const double still = form->base_forcing(self);
    *amplitude = HUGE_AMPLITUDE;
    form->find_forcing(self, with);
    parameter->base = (form->base_forcing(self) - still) / HUGE_AMPLITUDE;
    *amplitude = own;
    for (int j = 0; j < VI_MODES; ++j) {
        parameter->force[j] = (with[j] - without[j]) / HUGE_AMPLITUDE;
    }
    return true;
}

VI_RARE static bool find_of_contact(int k, size_t member, vi_parameter *parameter)
{
    parameter->port = k;
    switch (member) {
    case offsetof(vi_contact, position): parameter->position = 1.0; return true;
    case offsetof(vi_contact, law.restitution): parameter->restitution = 1.0; return true;
    case offsetof(vi_contact, law.yield_velocity): parameter->yield_velocity = 1.0; return true;
    case offsetof(vi_contact, law.stiffness): parameter->press_stiffness = 1.0; return true;
    case offsetof(vi_contact, law.damping): parameter->press_damping = 1.0; return true;
    case offsetof(vi_contact, law.exponent): parameter->press_exponent = 1.0; return true;
    default: return false;
    }
}

/* Describe a parameter, and the start of the motion over it; false: the body has no derivative over it. */
VI_RARE static bool find_parameter(void *self, uint32_t reference, vi_parameter *parameter, vi_sensitivity *of)
{
    const vi_variable *variable = &vi_this_description.variables[reference];
    int k;
    size_t member;
    memset(parameter, 0, sizeof *parameter);
    memset(of, 0, sizeof *of);
    parameter->port = -1;
    if (variable->type != VI_FLOAT64 || variable->count != 1
        || (variable->access != VI_SET_INITIAL && variable->access != VI_SET_TUNABLE)) {
        return false;
    }
    if (is_of_contact(variable->offset, &k, &member)) {
        return find_of_contact(k, member, parameter);
    }
    switch (variable->offset - form->place) {
    case offsetof(vi_body, forcing_phase): parameter->phase = 1.0; return true;
    case offsetof(vi_body, forcing_angular_frequency): parameter->frequency = 1.0; return true;
    default: return form->parameter(self, variable->offset, parameter, of);
    }
}

VI_RARE bool vi_body_follow(void *self, const vi_derivative_pair pairs[], size_t count, char message[VI_MESSAGE_LENGTH])
{
    vi_body *c = vi_body_of(self);
    vi_followed *followed = &c->followed;
    for (size_t i = 0; i < count; ++i) {
        int key = 0;
        while (key < c->sensitive.count && followed->key[key] != pairs[i].known) {
            ++key;
        }
        if (key == VI_KEYS || !is_followed(self, pairs[i].unknown)
            || !find_parameter(self, pairs[i].known, &c->sensitive.parameter[key], &c->sensitive.of[key])) {
            (void)snprintf(message, VI_MESSAGE_LENGTH,
                           "sensitivities.txt: expected outputs and at most %d parameters whose"
                           " derivatives the body has, got %lu and %lu",
                           VI_KEYS, (unsigned long)pairs[i].unknown, (unsigned long)pairs[i].known);
            return false;
        }
        followed->key[key] = pairs[i].known;
        c->sensitive.count = key == c->sensitive.count ? key + 1 : c->sensitive.count;
        followed->output[i] = pairs[i].unknown;
        followed->of[i] = key;
    }
    followed->count = (int64_t)count;
    return true;
}

VI_RARE size_t vi_body_followed(void)
{
    return form->place + offsetof(vi_body, followed) + offsetof(vi_followed, value);
}

/* ---- start ---- */

VI_RARE void vi_body_clear_sensitivities(void *self)
{
    vi_body *c = vi_body_of(self);
    c->sensitive.in_event = 0;
    memset(c->sensitive.of, 0, sizeof c->sensitive.of);
}

VI_RARE static void complain_of_setup(const vi_body *c, char *message)
{
    static const char start[] = "sensitivities: expected";
    if (c->state.exchange.on) {
        vi_complain(message, "%s co-simulation, got model exchange", start);
    }
    if (c->model.varies) {
        vi_complain(message, "%s modes that do not follow the amplitude, got amplitude parameters", start);
    }
    if (c->signals_key != 0) {
        vi_complain(message, "%s no signals of time among the forces, got some", start);
    }
    if (vi_structure_stops_move(&c->model)) {
        vi_complain(message, "%s stops that stand still, got some that move", start);
    }
    for (int k = 0; k < c->model.contacts; ++k) {
        if (vi_contact_law_is_external(c->contacts[k].law.law)) {
            vi_complain(message, "%s laws that the body evaluates itself, got another at contact[%d]", start, k + 1);
        }
        if (c->contacts[k].relaxation_time > 0.0) {
            vi_complain(message, "%s contact[%d].relaxation_time 0, got %.17g", start, k + 1,
                        c->contacts[k].relaxation_time);
        }
    }
    for (int i = 0; i < c->sensitive.count; ++i) {
        const vi_parameter *parameter = &c->sensitive.parameter[i];
        if ((parameter->phase != 0.0 || parameter->frequency != 0.0) && c->model.clock.angular_frequency == 0.0) {
            vi_complain(message, "%s forcing.angular_frequency > 0 for derivatives over it or its phase, got 0", start);
        }
    }
}

VI_RARE void vi_body_start_sensitivities(void *self, char message[VI_MESSAGE_LENGTH])
{
    vi_body *c = vi_body_of(self);
    for (int i = 0; i < c->sensitive.count; ++i) {
        if (!find_parameter(self, c->followed.key[i], &c->sensitive.parameter[i], &c->sensitive.of[i])) {
            vi_complain(message, "sensitivities: expected all modes of the masses in use for derivatives over masses,"
                                 " springs and dashpots, got fewer");
        }
    }
    if (c->sensitive.count > 0) {
        complain_of_setup(c, message);
    }
}

VI_RARE void vi_body_retune_sensitivities(void *self)
{
    vi_body *c = vi_body_of(self);
    for (int i = 0; i < c->sensitive.count; ++i) {
        c->sensitive.of[i].undefined |= c->sensitive.parameter[i].frequency != 0.0;
    }
}

/* ---- values ---- */

/* A displacement on its stop is shown as that of the stop; its derivative is that of the point. */
VI_RARE static void unhide(size_t offset, vi_line *line)
{
    int k;
    size_t member;
    const bool of_contact = is_of_contact(offset, &k, &member);
    if (offset == form->place + offsetof(vi_body, displacement)
        || (of_contact && member == offsetof(vi_contact, displacement))) {
        line->displacement = 1.0;
    }
}

VI_RARE static double value_of(void *self, int i, uint32_t reference, const vi_variation *change)
{
    const vi_body *c = vi_body_of(self);
    const vi_sensitivity *of = &c->sensitive.of[i];
    const size_t offset = offset_of(reference);
    vi_line line;
    int k;
    size_t member;
    if (of->undefined) {
        return NAN;
    }
    if (is_of_contact(offset, &k, &member) && member >= offsetof(vi_contact, last_time)) {
        return member == offsetof(vi_contact, last_time) ? of->last_time[k] : of->last_velocity[k];
    }
    memset(&line, 0, offsetof(vi_line, own));
    (void)vi_body_derivatives.row(self, reference, &line);
    unhide(offset, &line);
    return vi_line_read(&line, change);
}

VI_RARE void vi_body_show_sensitivities(void *self)
{
    vi_body *c = vi_body_of(self);
    const vi_structure s = vi_body_parts(c);
    vi_followed *followed = &c->followed;
    for (int i = 0; i < c->sensitive.count; ++i) {
        vi_variation change;
        memset(&change, 0, sizeof change);
        memcpy(change.displacement, c->sensitive.of[i].q, sizeof change.displacement);
        memcpy(change.velocity, c->sensitive.of[i].p, sizeof change.velocity);
        vi_parameter_source(&s, &c->sensitive.parameter[i], &change);
        vi_structure_carry(&s, &change);
        for (int64_t slot = 0; slot < followed->count; ++slot) {
            if (followed->of[slot] == i) {
                followed->value[slot] = value_of(self, i, followed->output[slot], &change);
            }
        }
    }
}
