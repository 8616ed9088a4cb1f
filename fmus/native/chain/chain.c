#include "chain.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "chain_variables.h"
#include "component.h"

enum { START_MASSES = 2 };
enum { STRIDE = CHAIN_CONTACT_APPLIED_RESTITUTION_2 - CHAIN_CONTACT_APPLIED_RESTITUTION_1 };

static void defaults(void *self)
{
    chain *c = self;
    c->masses = START_MASSES;
    c->masses_described = VI_MODES;
    for (int i = 0; i < VI_MODES; ++i) {
        c->parameter.mass[i] = c->parameter.stiffness[i] = 1.0;
    }
    vi_body_defaults(&c->body);
}

static void sized(void *self, const char *block, int count)
{
    chain *c = self;
    if (strcmp(block, "masses") == 0 && count >= 1 && count <= VI_MODES) {
        c->masses = c->masses_described = count;
    }
    vi_body_sized(&c->body, block, count);
}

/* ---- validation ---- */

static void check_mass_number(char *message, const char *name, const chain *c, int64_t number)
{
    if (number < 0 || number > c->masses) {
        vi_complain(message, "%s: expected 1 to %lld, or 0 for the last mass, got %lld", name, (long long)c->masses,
                    (long long)number);
    }
}

static void check_inputs(const chain *c, char *message)
{
    vi_check_each(message, vi_check_finite, "force", c->force, (int)c->masses);
    vi_check_each(message, vi_check_finite, "force_rate", c->force_rate, (int)c->masses);
}

static void check_forcing(const chain *c, char *message)
{
    vi_check_each(message, vi_check_finite, "forcing.amplitude", c->forcing_amplitude, (int)c->masses);
    vi_check_finite(message, "forcing.base_acceleration", c->forcing_base_acceleration);
}

static void check_masses(const chain *c, char *message)
{
    const int n = (int)c->masses;
    vi_check_each(message, vi_check_positive, "mass", c->parameter.mass, n);
    vi_check_each(message, vi_check_not_negative, "stiffness", c->parameter.stiffness, n);
    vi_check_each(message, vi_check_not_negative, "damping", c->parameter.damping, n);
    vi_check_not_negative(message, "far_stiffness", c->far_stiffness);
    vi_check_not_negative(message, "far_damping", c->far_damping);
    check_forcing(c, message);
    vi_check_each(message, vi_check_finite, "displacement_start", c->displacement_start, n);
    vi_check_each(message, vi_check_finite, "velocity_start", c->velocity_start, n);
}

static bool parameters_are_good(const chain *c, char *message)
{
    if (c->masses < 1 || c->masses > c->masses_described) {
        vi_complain(message, "masses: expected 1 to %lld, got %lld", (long long)c->masses_described,
                    (long long)c->masses);
        return false;
    }
    if (c->modes < 0 || c->modes > c->masses) {
        vi_complain(message, "modes: expected 1 to %lld, or 0 for all, got %lld", (long long)c->masses,
                    (long long)c->modes);
        return false;
    }
    check_masses(c, message);
    check_mass_number(message, "observed_mass", c, c->observed_mass);
    for (int k = 0; k < VI_PORTS; ++k) {
        if (!vi_contact_law_is_none(c->body.contacts[k].law.law)) {
            char name[32];
            (void)snprintf(name, sizeof name, "contact[%d].mass_number", k + 1);
            check_mass_number(message, name, c, c->contact_mass[k]);
        }
    }
    vi_body_check(&c->body, message);
    check_inputs(c, message);
    return message[0] == '\0';
}

/* ---- from parameters to modes ---- */

/* A port without a law may have any number: the last mass then. */
static int index_of(const chain *c, int64_t number)
{
    return (int)(number < 1 || number > c->masses ? c->masses : number) - 1;
}

static int modes_of(const chain *c)
{
    return (int)(c->modes == 0 ? c->masses : c->modes);
}

/* Sum over the masses of shape * load: the modal forces of loads on the masses. equations.md 5.2 */
static void project(const chain *c, const double load[VI_MODES], double modal[VI_MODES])
{
    for (int j = 0; j < modes_of(c); ++j) {
        modal[j] = 0.0;
        for (int i = 0; i < c->masses; ++i) {
            modal[j] += c->shape[i][j] * load[i];
        }
    }
}

static bool find_modes(chain *c, vi_chain_modes *modes, char *message)
{
    const int n = (int)c->masses;
    vi_chain parameter = c->parameter;
    parameter.masses = n;
    parameter.stiffness[n] = c->far_stiffness;
    parameter.damping[n] = c->far_damping;
    if (!vi_chain_find_modes(&parameter, modes)) {
        vi_complain(message, "mass, stiffness: expected a chain whose modes are finite numbers, got others");
        return false;
    }
    memcpy(c->shape, modes->shape, sizeof c->shape);
    return true;
}

/* Modal amplitudes of the harmonic force and of the base's inertial one; a force of frequency 0 is constant. */
static void find_forces(const chain *c, double force[VI_MODES])
{
    double load[VI_MODES];
    const bool constant = c->body.forcing_angular_frequency == 0.0;
    const double share = constant ? cos(c->body.forcing_phase) : 1.0;
    for (int i = 0; i < c->masses; ++i) {
        load[i] = c->forcing_amplitude[i] - c->parameter.mass[i] * c->forcing_base_acceleration;
    }
    project(c, load, force);
    for (int j = 0; j < modes_of(c); ++j) {
        force[j] *= share;
    }
}

static void fill_model(chain *c, const vi_chain_modes *modes)
{
    vi_structure_model *model = &c->body.model;
    double force[VI_MODES];
    find_forces(c, force);
    model->modes = (int32_t)modes_of(c);
    model->contacts = vi_body_ports(&c->body);
    model->coupled = !modes->classical;
    memset(c->body.natural, 0, sizeof c->body.natural);
    for (int j = 0; j < model->modes; ++j) {
        c->body.natural[j] = modes->natural[j];
        vi_structure_mode(model, j, modes->natural[j], modes->damping_ratio[j], force[j],
                          c->body.forcing_angular_frequency);
        memcpy(model->coupling[j], modes->damping[j], sizeof model->coupling[j]);
    }
    for (int k = 0; k < VI_PORTS; ++k) {
        memcpy(model->shape[k], c->shape[index_of(c, c->contact_mass[k])], sizeof model->shape[k]);
        memcpy(model->impulse[k], model->shape[k], sizeof model->impulse[k]);
    }
    memcpy(model->observed, c->shape[index_of(c, c->observed_mass)], sizeof model->observed);
}

/* q = Psi' M x, the inverse of x = Psi q where all modes are in use; else what of x those in use can do. */
static void start_modes(chain *c)
{
    double displacement[VI_MODES], velocity[VI_MODES];
    for (int i = 0; i < c->masses; ++i) {
        displacement[i] = c->parameter.mass[i] * c->displacement_start[i];
        velocity[i] = c->parameter.mass[i] * c->velocity_start[i];
    }
    project(c, displacement, c->body.state.q);
    project(c, velocity, c->body.state.p);
}

/* As an importer integrates it: its states are those of the masses. */
static vi_exchange_body exchange_body(chain *c)
{
    vi_exchange_body body = vi_body_exchange(&c->body);
    body.modes = (int)c->masses_described;
    body.shape = (const double(*)[VI_MODES])c->shape;
    body.mass = c->parameter.mass;
    body.refused = modes_of(c) < c->masses ? "modes" : body.refused;
    return body;
}

/* ---- life ---- */

static void hold_inputs(chain *c)
{
    double load[VI_MODES], rate[VI_MODES], held[VI_MODES], held_rate[VI_MODES];
    for (int i = 0; i < c->masses; ++i) {
        load[i] = c->force[i] - c->parameter.mass[i] * c->body.base_acceleration;
        rate[i] = c->force_rate[i] - c->parameter.mass[i] * c->body.base_acceleration_rate;
    }
    project(c, load, held);
    project(c, rate, held_rate);
    vi_body_hold(&c->body, held, held_rate);
}

static void drive(chain *c)
{
    double force[VI_MODES];
    if (c->body.forcing_changed) {
        find_forces(c, force);
        vi_body_drive(&c->body, force);
    }
}

static void refresh_inputs(chain *c)
{
    drive(c);
    if (c->body.inputs_changed) {
        vi_body_take_impulses(&c->body);
        hold_inputs(c);
    }
}

static void update_outputs(void *self)
{
    chain *c = self;
    refresh_inputs(c);
    c->time = vi_body_time(&c->body);
    const double base = vi_body_base_acceleration(&c->body, c->forcing_base_acceleration);
    vi_body_outputs(&c->body, base);
    for (int i = 0; i < c->masses; ++i) {
        c->displacement[i] = vi_structure_at(&c->body.model, c->shape[i], c->body.state.q);
        c->velocity[i] = vi_structure_at(&c->body.model, c->shape[i], c->body.state.p);
        c->relative_acceleration[i] = vi_structure_at(&c->body.model, c->shape[i], c->body.modal_acceleration);
        c->acceleration[i] = c->relative_acceleration[i] + base;
    }
    if (c->body.state.exchange.on) {
        const vi_exchange_body body = exchange_body(c);
        vi_exchange_show_indicators(&body);
    }
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    chain *c = self;
    vi_chain_modes modes;
    if (!parameters_are_good(c, message) || !find_modes(c, &modes, message)) {
        return false;
    }
    fill_model(c, &modes);
    start_modes(c);
    if (!vi_body_start(&c->body, start_time, "displacement_start", message)) {
        return false;
    }
    hold_inputs(c);
    update_outputs(c);
    return true;
}

static void was_set(void *self, uint32_t reference)
{
    chain *c = self;
    const size_t offset = vi_this_component.variables[reference].offset, first = offsetof(chain, forcing_amplitude);
    if ((offset >= first && offset < first + sizeof c->forcing_amplitude)
        || reference == CHAIN_FORCING_BASE_ACCELERATION || reference == CHAIN_FORCING_ANGULAR_FREQUENCY) {
        c->body.forcing_changed = 1;
    }
    vi_body_was_set(&c->body, reference, CHAIN_CONTACT_APPLIED_RESTITUTION_1, STRIDE,
                                   CHAIN_RECORD_TAKEN);
}

static bool resolve(void *self, char message[VI_MESSAGE_LENGTH])
{
    chain *c = self;
    if (!vi_body_resolve(&c->body, message)) {
        return false;
    }
    update_outputs(c);
    return true;
}

/* Of a tuned forcing that the body has not gone on with. */
static void check_drive(const chain *c, char *message)
{
    if (c->body.forcing_changed) {
        check_forcing(c, message);
        vi_body_check_drive(&c->body, message);
    }
}

static vi_step_result step(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    chain *c = self;
    vi_instant target;
    drive(c);
    check_inputs(c, message);
    check_drive(c, message);
    if (!vi_body_step_is_good(&c->body, request, &target, message)
        || !vi_body_resolve(&c->body, message)) {
        return VI_STEP_ERROR;
    }
    if (!vi_body_continues(&c->body)) {
        vi_body_take_impulses(&c->body);
        hold_inputs(c);
    }
    const vi_step_result result = vi_body_advance(&c->body, target, request, message);
    update_outputs(c);
    return result;
}

static bool event_pending(const void *self)
{
    return ((const chain *)self)->body.state.pending != 0;
}

static bool needs_events(const void *self)
{
    return vi_body_needs_events(&((const chain *)self)->body);
}

static double present_time(const void *self)
{
    return vi_body_time(&((const chain *)self)->body);
}

static size_t used_size(const void *self)
{
    return sizeof(chain) - vi_body_unused(&((const chain *)self)->body);
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
