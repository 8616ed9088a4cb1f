#include "door/door.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "body/modal/modal_scan.h"
#include "body/modal/structure/contact.h"
#include "body/modal/structure/structure.h"

/* A body of one mode, mass-normalised, with at most one stop. */
typedef struct {
    vi_structure_model model;
    vi_structure_state state;
    vi_contact contact;
    vi_record record;
    double root;   /* sqrt(mass) */
    vi_scan *scan; /* NULL: one flight does not repay it */
} body;

static vi_structure parts_of(body *b)
{
    return (vi_structure){&b->model, &b->state, &b->contact, &b->record, NULL, b->scan, NULL, NULL, {0, NULL, NULL, NULL}, NULL};
}

static bool start(body *b, const vi_door_oscillator *o, double phase, const double state[2], const vi_contact *contact)
{
    memset(b, 0, sizeof *b);
    if (!(o->mass > 0.0) || !(o->damping >= 0.0) || !(o->stiffness >= 0.0) || !(o->angular_frequency >= 0.0)
        || !isfinite(o->mass + o->damping + o->stiffness + o->amplitude + phase + state[0] + state[1])
        || !isfinite(contact->position)) {
        return false;
    }
    b->root = sqrt(o->mass);
    b->contact = *contact;
    b->model.modes = 1;
    b->model.contacts = vi_contact_law_has_stop(contact->law.law);
    vi_mode *mode = &b->model.mode[0];
    vi_mode_start(mode, o->mass, o->damping, o->stiffness, 0.0, 0.0);
    vi_mode_drive(mode, o->amplitude / b->root, o->angular_frequency);
    b->model.shape[0][0] = b->model.impulse[0][0] = b->model.observed[0] = 1.0 / b->root;
    vi_structure_prepare(&b->model);
    b->state.q[0] = b->root * state[0];
    b->state.p[0] = b->root * state[1];
    vi_instant now;
    if (!vi_clock_start(&b->model.clock, o->angular_frequency, phase, mode->natural)
        || !vi_clock_instant(&b->model.clock, 0.0, 0.0, &now)) {
        return false;
    }
    const vi_structure s = parts_of(b);
    vi_structure_start(&s, now);
    return true;
}

static bool advance(body *b, double from, double to, bool stop_at_contacts)
{
    const vi_structure s = parts_of(b);
    const vi_step_request request = {from, to - from, stop_at_contacts, false};
    vi_instant target;
    return to >= from && vi_clock_instant(&b->model.clock, to, 0.0, &target)
           && vi_structure_advance(&s, target, &request) < VI_STEP_ERROR;
}

static void motion_now(body *b, double *displacement, double *velocity)
{
    const vi_structure s = parts_of(b);
    double acceleration[VI_MODES];
    vi_structure_outputs(&s, acceleration);
    *displacement = vi_structure_observed(&s);
    *velocity = b->state.p[0] / b->root;
}

VI_DOOR int vi_door_flow(const vi_door_oscillator *oscillator, double phase, const double state[2], double held,
                      double held_rate, double duration, double end[2])
{
    body b;
    const vi_contact none = {.law = vi_contact_law_none(), .side = VI_SIDE_UPPER};
    if (!start(&b, oscillator, phase, state, &none) || !isfinite(held + held_rate)) {
        return 1;
    }
    const double load[VI_MODES] = {b.root * held}, rate[VI_MODES] = {b.root * held_rate};
    const vi_structure s = parts_of(&b);
    vi_structure_hold(&s, load, rate);
    vi_structure_meet_forces(&s);
    if (!advance(&b, 0.0, duration, true)) {
        return 1;
    }
    motion_now(&b, &end[0], &end[1]);
    return 0;
}

VI_DOOR int vi_door_next_contact(const vi_door_oscillator *oscillator, double phase, const double state[2],
                              double position, int side, double duration, double contact[2])
{
    body b;
    /* an external law stops there and resolves nothing */
    const vi_contact stop = {.law = vi_contact_law_asking(), .side = side, .position = position};
    if (!start(&b, oscillator, phase, state, &stop)) {
        return -1;
    }
    const double approach = vi_contact_direction(side) * state[1];
    if (state[0] == position && approach > 0.0) {
        contact[0] = 0.0;
        contact[1] = approach;
        return 1;
    }
    const vi_instant begin = b.state.now;
    if (!advance(&b, 0.0, duration, true)) {
        return -1;
    }
    if (!b.state.pending) {
        return 0;
    }
    contact[0] = vi_clock_elapsed(&b.model.clock, begin, b.state.now);
    contact[1] = fabs(b.state.p[0]) / b.root;
    return 1;
}

VI_DOOR int vi_door_motion(const vi_door_oscillator *oscillator, double phase, const double state[2], double position,
                           int side, double restitution, int count, const double instants[], double displacement[],
                           double velocity[])
{
    body b;
    const vi_contact stop = {.law = side == 0 ? vi_contact_law_none() : vi_contact_law_rigid(restitution),
                             .side = side == 0 ? VI_SIDE_UPPER : side,
                             .position = position};
    if (!(restitution >= 0.0 && restitution <= 1.0) || !start(&b, oscillator, phase, state, &stop)) {
        return -1;
    }
    vi_scan scan;
    scan.modes = 0; /* the cache is empty */
    b.scan = &scan;
    double reached = 0.0;
    for (int i = 0; i < count; ++i) {
        if (!advance(&b, reached, instants[i], false)) {
            return -1;
        }
        reached = instants[i];
        motion_now(&b, &displacement[i], &velocity[i]);
    }
    return (int)b.contact.count;
}
