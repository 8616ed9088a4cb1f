#include "body.h"

#include <math.h>
#include <string.h>

#include "body/modal/stop_motion.h"
#include "body/modal/structure/contact.h"
#include "body/modal/structure/impact.h"
#include "body/modal/structure/jam.h"
#include "body/modal/structure/moved_stops.h"
#include "body/modal/structure/unbounded.h"
#include "body_check.h"
#include "body_derivatives.h"
#include "body_exchange.h"

static const vi_body_form *const form = &vi_this_body;

static const double DEFAULT_TOLERANCE = 1e-10; /* default contact_tolerance */

vi_body *vi_body_of(void *self)
{
    return (vi_body *)(void *)((char *)self + form->place);
}

static const vi_body *const_body_of(const void *self)
{
    return (const vi_body *)(const void *)((const char *)self + form->place);
}

vi_structure vi_body_parts(vi_body *c)
{
    const bool any_signals = VI_SIGNALS > 0 && c->signals_key != 0;
    if (any_signals && c->signals.key != c->signals_key) { /* at the start, or after a state of another set-up */
        form->make_signals((char *)c - form->place, &c->signals);
        c->signals.key = c->signals_key;
    }
    const bool follows = c->sensitive.count > 0;
    if (follows) {
        c->sensitive.base_held = c->base_acceleration;
        c->sensitive.base_rate = c->base_acceleration_rate;
        c->sensitive.base_amplitude = form->base_forcing((const char *)c - form->place);
        c->sensitive.base_since = c->state.input_since;
    }
    const vi_table tables = form->tables != NULL ? form->tables((const char *)c - form->place) : (vi_table){0, NULL, NULL, NULL};
    return (vi_structure){&c->model, &c->state, c->contacts, &c->record, &c->pressed, &c->scan, &c->power,
                          any_signals ? &c->signals : NULL, tables, follows ? &c->sensitive : NULL};
}

static void defaults(void *self)
{
    vi_body *c = vi_body_of(self);
    form->defaults(self);
    c->contact_tolerance = DEFAULT_TOLERANCE;
    c->contacts_used = c->contacts_described = VI_PORTS;
    for (int k = 0; k < VI_PORTS; ++k) {
        c->contacts[k].side = VI_SIDE_UPPER;
        c->contacts[k].law.restitution = 1.0;
        c->contacts[k].law.exponent = 1.5;
        vi_contact_clear(&c->contacts[k]);
    }
}

/* The model description has `count` ports, or (`external_laws`, 0) no law that another component answers. */
static void sized(void *self, const char *block, int count)
{
    vi_body *c = vi_body_of(self);
    if (form->sized != NULL) {
        form->sized(self, block, count);
    }
    if (strcmp(block, "contacts") == 0 && count >= 0 && count <= VI_PORTS) {
        c->contacts_used = c->contacts_described = count;
    }
    if (strcmp(block, "external_laws") == 0) {
        c->external_hidden = count == 0;
    }
    if (strcmp(block, "strobes") == 0) {
        c->strobe.described = count > 0;
    }
}

/* ---- resources: those of a body without a file are its table of functions, which tells that they are open ---- */

static void *open_resources(const char *folder, char message[VI_MESSAGE_LENGTH])
{
    return form->open != NULL ? form->open(folder, message) : (void *)(uintptr_t)form;
}

static void attach(void *self, const void *resources)
{
    if (form->attach != NULL) {
        form->attach(self, resources);
    }
}

static void close_resources(void *resources)
{
    if (form->close != NULL) {
        form->close(resources);
    }
}

int vi_body_ports(const vi_body *c)
{
    int ports = VI_PORTS;
    while (ports > 0 && vi_contact_law_is_none(c->contacts[ports - 1].law.law)) {
        --ports;
    }
    return ports;
}

/* ---- inputs ---- */

/* Take changed motions of stops; false where one would cut into the body. */
static bool move_stops(const void *self, vi_body *c)
{
    vi_stop_motion motion[VI_PORTS];
    const vi_structure parts = vi_body_parts(c);
    c->stop_refused = 0;
    if (form->find_stops == NULL) {
        return true;
    }
    form->find_stops(self, motion);
    return vi_structure_move_stops(&parts, motion, &c->stop_refused);
}

static void drive(void *self, vi_body *c)
{
    double force[VI_MODES] = {0.0};
    char message[VI_MESSAGE_LENGTH] = "";
    if (!c->forcing_changed) {
        return;
    }
    form->check_forcing(self, message);
    form->find_forcing(self, force);
    bool good = message[0] == '\0'
                && vi_clock_can_retune(&c->model.clock, c->forcing_angular_frequency, c->state.now);
    for (int j = 0; j < vi_structure_free_modes(&c->model); ++j) {
        good = good && isfinite(force[j]);
    }
    if (good) {
        const vi_structure parts = vi_body_parts(c);
        if (c->forcing_angular_frequency != c->model.clock.angular_frequency) {
            vi_body_retune_sensitivities(self);
        }
        vi_structure_drive(&parts, force, c->forcing_angular_frequency);
        vi_stop_motions_count_by(&c->model);
        if (form->drive_further != NULL) {
            form->drive_further(self, false);
        }
        vi_structure_load(&parts);
        c->forcing_changed = !move_stops(self, c);
    }
}

/* Impulses of the contacts act before new forces. */
static void take_impulses(vi_body *c)
{
    const vi_structure parts = vi_body_parts(c);
    vi_structure_take_impulses(&parts);
}

static void hold_inputs(void *self, vi_body *c)
{
    double held[VI_MODES] = {0.0}, held_rate[VI_MODES] = {0.0};
    const vi_structure parts = vi_body_parts(c);
    form->find_inputs(self, held, held_rate);
    vi_structure_hold(&parts, held, held_rate);
    vi_structure_load(&parts);
    vi_structure_meet_forces(&parts);
    c->inputs_changed = 0;
}

void vi_body_refresh_inputs(void *self)
{
    vi_body *c = vi_body_of(self);
    drive(self, c);
    if (c->inputs_changed) {
        take_impulses(c);
        hold_inputs(self, c);
    }
}

static void was_set(void *self, uint32_t reference)
{
    vi_body *c = vi_body_of(self);
    const uint32_t from_first = reference - form->restitution; /* a large number for references below the first */
    if (vi_this_description.variables[reference].access == VI_SET_TUNABLE) {
        c->forcing_changed = 1;
    }
    if (reference == form->taken) {
        vi_record_take(&c->record);
        return;
    }
    c->inputs_changed = 1;
    vi_record_switched(&c->record);
    if (from_first % form->stride == 0 && from_first / form->stride < VI_PORTS) {
        c->contacts[from_first / form->stride].answered = 1;
    }
}

/* ---- outputs ---- */

static double present_time(const void *self)
{
    const vi_body *c = const_body_of(self);
    return vi_clock_time(&c->model.clock, c->state.now);
}

double vi_body_cosine_of_forcing(const vi_body *c)
{
    const double w = c->model.clock.angular_frequency;
    return w > 0.0 ? cos(w * c->state.now.rest) : cos(c->forcing_phase);
}

/* Present acceleration of the base, m/s^2: the input, plus the forcing of this amplitude (m/s^2). */
static double base_acceleration(const vi_body *c, double amplitude)
{
    const double since = vi_clock_elapsed(&c->model.clock, c->state.input_since, c->state.now);
    const double input = c->base_acceleration + (c->state.exchange.on ? 0.0 : c->base_acceleration_rate * since);
    return amplitude == 0.0 ? input : input + amplitude * vi_body_cosine_of_forcing(c);
}

static void update_energies(vi_body *c)
{
    c->energy_kinetic = c->energy_potential = 0.0;
    for (int j = 0; j < vi_structure_free_modes(&c->model); ++j) {
        const double p = c->state.p[j], stretch = c->natural[j] * c->state.q[j];
        const double elastic = copysign(stretch * stretch, c->natural[j]);
        c->energy_kinetic += 0.5 * p * p;
        c->energy_potential += 0.5 * elastic;
        c->modal_energy[j] = c->record_energies ? 0.5 * (p * p + elastic) : 0.0;
    }
}

static void update_outputs(void *self)
{
    vi_body *c = vi_body_of(self);
    vi_body_refresh_inputs(self);
    *(double *)(void *)((char *)self + vi_this_description.time) = present_time(self);
    const vi_structure parts = vi_body_parts(c);
    double base = base_acceleration(c, form->base_forcing(self));
    if (form->base_further != NULL) {
        base += form->base_further(self, vi_structure_further(&parts), c->state.signal_value);
    }
    vi_structure_outputs(&parts, c->modal_acceleration);
    c->displacement = vi_structure_observed(&parts);
    c->velocity = vi_structure_at(&c->model, c->model.observed, c->state.p);
    c->acceleration = vi_structure_at(&c->model, c->model.observed, c->modal_acceleration) + base;
    update_energies(c);
    form->update_outputs(self, base);
    if (c->state.exchange.on) {
        vi_body_show_indicators(self);
    }
    if (parts.sensitive != NULL) {
        vi_body_show_sensitivities(self);
    }
}

/* ---- start ---- */

static double lowest_natural(const vi_body *c)
{
    for (int j = 0; j < vi_structure_free_modes(&c->model); ++j) {
        if (c->natural[j] != 0.0) {
            return fabs(c->natural[j]);
        }
    }
    return 0.0;
}

static bool start_clock(vi_body *c, double start_time, vi_instant *now, char *message)
{
    vi_clock *clock = &c->model.clock;
    if (vi_clock_start(clock, c->forcing_angular_frequency, c->forcing_phase, lowest_natural(c))
        && isfinite(start_time) && vi_clock_instant(clock, start_time, 0.0, now)) {
        return true;
    }
    vi_complain(message, "forcing.angular_frequency: expected a period between 1e-300 and 1e300 s that a start time of"
                         " %.17g s can be counted in, got %.17g rad/s", start_time, c->forcing_angular_frequency);
    return false;
}

static bool starts_free(vi_body *c, char *message)
{
    const vi_structure parts = vi_body_parts(c);
    const int beyond = vi_structure_beyond(&parts);
    if (beyond == 0) {
        return true;
    }
    const vi_contact *contact = &c->contacts[beyond - 1];
    vi_complain(message, "%s: expected a start on the free side of contact[%d] (%s %.17g), got %.17g there", form->start,
                beyond, contact->side == VI_SIDE_UPPER ? "<=" : ">=", vi_structure_stop_position(&parts, beyond - 1),
                vi_structure_at_body(&c->model, c->model.shape[beyond - 1], c->state.q));
    return false;
}

static bool start(void *self, vi_body *c, double start_time, char *message)
{
    for (int k = 0; k < VI_PORTS; ++k) {
        vi_contact_clear(&c->contacts[k]);
    }
    memset(c->state.status, 0, sizeof c->state.status); /* clears a start with other start values */
    c->forcing_changed = c->stop_refused = 0;
    c->model.tolerance = c->contact_tolerance;
    vi_structure_prepare(&c->model);
    vi_body_check_points(c, message);
    vi_instant now;
    if (!start_clock(c, start_time, &now, message)) {
        return false;
    }
    const vi_structure parts = vi_body_parts(c);
    c->state.held_since = now;
    vi_stop_motions_count_by(&c->model);
    vi_stop_motions_at(&parts, now);
    if (!starts_free(c, message) || message[0] != '\0') {
        return false;
    }
    if (form->drive_further != NULL) {
        form->drive_further(self, true);
    }
    vi_body_clear_sensitivities(self);
    vi_structure_start(&parts, now);
    vi_body_start_sensitivities(self, message);
    return message[0] == '\0';
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    vi_body *c = vi_body_of(self);
    if (!vi_body_use_contacts(c, message) || !form->prepare(self, message) || !start(self, c, start_time, message)) {
        return false;
    }
    hold_inputs(self, c);
    update_outputs(self);
    vi_strobe_start(c);
    if (form->warn != NULL) {
        form->warn(self, message);
    }
    return true;
}

/* ---- steps ---- */

/* Resolve the pending contact; false when the answer is missing or bad. */
static bool resolve_pending(vi_body *c, char *message)
{
    if (!c->state.pending) {
        return true;
    }
    if (!vi_body_check_answers(c, message)) {
        return false;
    }
    const vi_structure parts = vi_body_parts(c);
    vi_structure_resolve(&parts);
    return true;
}

static bool resolve(void *self, char message[VI_MESSAGE_LENGTH])
{
    if (!resolve_pending(vi_body_of(self), message)) {
        return false;
    }
    update_outputs(self);
    return true;
}

/* Does the next step continue a step that ended for want of budget or room, under the same inputs? Then the slopes of
 * the inputs, and the results of its start, stay. */
static bool continues(const vi_body *c)
{
    return c->state.budget.unfinished && !c->inputs_changed;
}

/* Complain of a tuned forcing with which the body cannot go on. */
static void check_drive(const void *self, const vi_body *c, char *message)
{
    if (c->forcing_changed) {
        form->check_forcing(self, message);
        vi_check_retuning(message, &c->model.clock, c->forcing_angular_frequency, c->state.now);
        if (c->stop_refused > 0) {
            vi_complain(message, "stop[%d]: expected a motion that leaves the point on the free side of contact[%d] now,"
                                 " at %.17g s, got another", c->stop_refused, c->stop_refused,
                        vi_clock_time(&c->model.clock, c->state.now));
        }
    }
}

static vi_step_result advance(vi_body *c, vi_instant target, const vi_step_request *request, char *message)
{
    const vi_structure parts = vi_body_parts(c);
    c->state.follow_energies = c->record_energies;
    const vi_step_result result = vi_structure_advance(&parts, target, request);
    if (result == VI_STEP_STANDSTILL && !vi_structure_jam_complains(&parts, message)) {
        vi_structure_complain(&parts, message);
    }
    if (result == VI_STEP_UNBOUNDED) {
        vi_complain_of_growth(&parts, message, vi_clock_time(&c->model.clock, c->state.now));
    }
    vi_complain_of_end(message, result, vi_clock_time(&c->model.clock, c->state.now));
    return result;
}

static vi_step_result step(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    vi_body *c = vi_body_of(self);
    vi_instant target;
    drive(self, c);
    form->check_inputs(self, message);
    check_drive(self, c, message);
    if (!vi_body_check_step(c, request, &target, message) || !resolve_pending(c, message)) {
        return VI_STEP_ERROR;
    }
    if (!continues(c)) {
        take_impulses(c);
        if (form->follow_amplitudes != NULL) {
            form->follow_amplitudes(self);
        }
        hold_inputs(self, c);
    }
    const bool early = vi_strobe_ends_step(c, request, &target);
    const vi_step_result result = advance(c, target, request, message);
    update_outputs(self);
    vi_strobe_pass(c, request);
    return early && result == VI_STEP_DONE ? VI_STEP_STROBE : result;
}

static bool event_pending(const void *self)
{
    return const_body_of(self)->state.pending != 0;
}

static bool needs_events(const void *self)
{
    for (int k = 0; k < VI_PORTS && k < const_body_of(self)->contacts_used; ++k) {
        if (vi_contact_law_asks(const_body_of(self)->contacts[k].law.law)) {
            return true;
        }
    }
    return false;
}

/* ---- the clock of the strobes ---- */

static bool clock_is_due(const void *self)
{
    return vi_strobe_is_due(const_body_of(self));
}

static double tick(void *self)
{
    vi_body *c = vi_body_of(self);
    if (vi_strobe_is_due(c)) {
        update_outputs(self);
    }
    return vi_strobe_tick(c);
}

static double next_tick(void *self)
{
    vi_body_refresh_inputs(self); /* a tuned frequency moves the tick */
    return vi_strobe_next(vi_body_of(self));
}

/* Bytes of `pressed`, `scan`, `power` and `signals`, the last members. */
enum { CACHES = sizeof(vi_pressed_cache) + sizeof(vi_scan) + sizeof(vi_power_tables) + sizeof(vi_signal_loads) };

/* Caches, unused rows of the record and derivatives that no one follows are not saved. */
static size_t used_size(const void *self)
{
    const vi_body *c = const_body_of(self);
    const size_t followed = sizeof c->sensitive + sizeof c->followed;
    return vi_this_description.struct_size - CACHES
           - (c->sensitive.count > 0 ? 0 : vi_record_unused(&c->record) + followed);
}

const vi_component vi_this_component = {
    .defaults = defaults,
    .initialize = initialize,
    .was_set = was_set,
    .update_outputs = update_outputs,
    .step = step,
    .resolve = resolve,
    .event_pending = event_pending,
    .needs_events = needs_events,
    .clock_is_due = clock_is_due,
    .tick = tick,
    .next_tick = next_tick,
    .time = present_time,
    .used_size = used_size,
    .cache_size = CACHES,
    .sized = sized,
    .open = open_resources,
    .attach = attach,
    .close = close_resources,
    .exchange = &vi_body_exchange,
    .partial = &vi_body_derivatives,
    .follow = vi_body_follow,
    .followed = vi_body_followed,
};
