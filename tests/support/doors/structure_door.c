#include "structure_door.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "body/modal/modal_scan.h"
#include "body/modal/power_tables.h"
#include "body/modal/pressed_flow.h"
#include "body/modal/structure/structure.h"

struct vi_door_structure {
    vi_structure_model model;
    vi_structure_state state;
    vi_contact contacts[VI_PORTS];
    vi_record record;
    vi_pressed_cache pressed;
    vi_scan scan;
    vi_power_tables power;
    int by_series; /* long rests and contacts with a power law too */
};

static vi_structure parts(vi_door_structure *d)
{
    return (vi_structure){&d->model, &d->state, d->contacts, &d->record, d->by_series ? NULL : &d->pressed,
                          &d->scan, d->by_series ? NULL : &d->power, NULL, {0, NULL, NULL, NULL}, NULL};
}

static void set_stop(vi_contact *contact, const vi_door_stop *stop)
{
    contact->law = (vi_contact_law){(int64_t)stop->law, stop->restitution, stop->yield_velocity,
                                    stop->stiffness,    stop->damping,     stop->exponent};
    contact->side = (int64_t)stop->side;
    contact->position = stop->position;
    contact->relaxation_time = stop->relaxation_time;
}

static bool start(vi_door_structure *d, double angular_frequency, double phase)
{
    double lowest = 0.0;
    for (int j = d->model.modes - 1; j >= 0; --j) {
        lowest = d->model.mode[j].natural > 0.0 ? d->model.mode[j].natural : lowest;
    }
    vi_instant now;
    if (!vi_clock_start(&d->model.clock, angular_frequency, phase, lowest)
        || !vi_clock_instant(&d->model.clock, 0.0, 0.0, &now)) {
        return false;
    }
    const vi_structure s = parts(d);
    vi_structure_prepare(&d->model);
    vi_structure_start(&s, now);
    return vi_structure_beyond(&s) == 0;
}

VI_DOOR vi_door_structure *vi_door_structure_new(int modes, const double natural[], const double damping_ratio[],
                                                 const double force[], double angular_frequency, double phase,
                                                 const double coupling[], int contacts, const vi_door_stop stops[],
                                                 const double shapes[], const double impulses[], const double q[],
                                                 const double p[], double tolerance)
{
    if (modes < 1 || modes > VI_MODES || contacts < 0 || contacts > VI_PORTS) {
        return NULL;
    }
    for (int k = 0; k < contacts; ++k) {
        if (!vi_contact_law_exists((int64_t)stops[k].law)) {
            return NULL;
        }
    }
    vi_door_structure *d = calloc(1, sizeof *d);
    if (d == NULL) {
        return NULL;
    }
    const size_t size = (size_t)modes * sizeof(double);
    d->model.modes = modes;
    d->model.contacts = contacts;
    d->model.tolerance = tolerance;
    d->model.coupled = coupling != NULL;
    for (int j = 0; j < modes; ++j) {
        vi_structure_mode(&d->model, j, natural[j], coupling == NULL ? damping_ratio[j] : 0.0, force[j],
                          angular_frequency);
        if (coupling != NULL) {
            memcpy(d->model.coupling[j], coupling + j * modes, size);
        }
    }
    for (int k = 0; k < contacts; ++k) {
        set_stop(&d->contacts[k], &stops[k]);
        memcpy(d->model.shape[k], shapes + k * modes, size);
        memcpy(d->model.impulse[k], (impulses == NULL ? shapes : impulses) + k * modes, size);
    }
    memcpy(d->state.q, q, size);
    memcpy(d->state.p, p, size);
    if (!start(d, angular_frequency, phase)) {
        free(d);
        return NULL;
    }
    return d;
}

VI_DOOR void vi_door_structure_free(vi_door_structure *structure)
{
    free(structure);
}

VI_DOOR void vi_door_structure_by_series(vi_door_structure *structure)
{
    structure->by_series = 1;
}

VI_DOOR void vi_door_structure_at_once(vi_door_structure *structure)
{
    structure->state.budget.events = INT32_MAX;
}

VI_DOOR void vi_door_structure_record(vi_door_structure *structure, const double observed[], int impacts, int extrema,
                                      int periods, int energies)
{
    memcpy(structure->model.observed, observed, (size_t)structure->model.modes * sizeof(double));
    structure->record.impacts = impacts;
    structure->record.extrema = extrema;
    structure->record.periods = periods;
    structure->state.follow_energies = energies;
}

VI_DOOR void vi_door_structure_limit(vi_door_structure *structure, double displacement_limit, int ends_unbounded)
{
    structure->model.displacement_limit = displacement_limit;
    structure->model.ends_unbounded = ends_unbounded;
}

VI_DOOR int vi_door_structure_advance(vi_door_structure *structure, double duration, const double held[],
                                      const double held_rate[], double most_impacts)
{
    vi_clock *clock = &structure->model.clock;
    const vi_structure s = parts(structure);
    const double now = vi_clock_time(clock, structure->state.now), high = now + duration, part = high - now;
    const double low = (now - (high - part)) + (duration - part);
    const vi_step_request request = {now, duration, false, true};
    vi_instant target;
    if (!(duration > 0.0) || !vi_clock_instant(clock, high, low, &target)) {
        return VI_STEP_ERROR;
    }
    const vi_budget *budget = &structure->state.budget;
    if (!budget->unfinished) {
        structure->model.impact_limit = most_impacts > 0.0 ? budget->events + (int64_t)most_impacts : 0;
        vi_structure_hold(&s, held, held_rate);
    }
    return (int)vi_structure_advance(&s, target, &request);
}

VI_DOOR void vi_door_structure_complaint(vi_door_structure *structure, int result, char message[])
{
    const vi_structure s = parts(structure);
    message[0] = '\0';
    if (result == VI_STEP_STANDSTILL) {
        vi_structure_complain(&s, message);
    }
    vi_complain_of_end(message, (vi_step_result)result, vi_clock_time(&structure->model.clock, structure->state.now));
}

VI_DOOR void vi_door_structure_state(vi_door_structure *structure, double q[], double p[], int status[], double force[],
                                     double facts[6])
{
    const vi_structure s = parts(structure);
    const vi_structure_state *state = &structure->state;
    double acceleration[VI_MODES];
    vi_structure_outputs(&s, acceleration);
    memcpy(q, state->q, (size_t)structure->model.modes * sizeof(double));
    memcpy(p, state->p, (size_t)structure->model.modes * sizeof(double));
    for (int k = 0; k < structure->model.contacts; ++k) {
        status[k] = state->status[k];
        force[k] = structure->contacts[k].force;
    }
    facts[0] = vi_clock_time(&structure->model.clock, state->now);
    facts[1] = state->energies.forcing_work;
    facts[2] = state->energies.damping_loss;
    facts[3] = state->energies.contact_loss;
    facts[4] = structure->record.displacement_max;
    facts[5] = structure->record.displacement_min;
}

VI_DOOR double vi_door_structure_work(const vi_door_structure *structure)
{
    return (double)(structure->state.budget.since_mark + structure->pressed.spent);
}

VI_DOOR int vi_door_structure_rows(vi_door_structure *structure, double rows[], int room)
{
    vi_record *record = &structure->record;
    const int64_t count = record->count < room ? record->count : room;
    memcpy(rows, record->rows, (size_t)count * VI_RECORD_WIDTH * sizeof(double));
    record->taken = count;
    vi_record_take(record);
    return (int)count;
}
