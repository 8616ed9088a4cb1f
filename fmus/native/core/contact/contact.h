/* A contact port: the point of a body that may meet a stop. Units: SI. */
#ifndef VIBROIMPACT_CONTACT_H
#define VIBROIMPACT_CONTACT_H

#include <math.h>
#include <stdint.h>

#include "contact/contact_law.h"

typedef struct {
    /* parameters */
    vi_contact_law law;
    int64_t side;
    double position;
    double relaxation_time; /* time in which a compliant stop's surface returns after separation, s; 0: at once */
    /* the importer's answers for the external laws */
    double applied_restitution;
    double applied_force, applied_stiffness, applied_damping;
    double applied_impulse; /* along +displacement, N s; given once, then 0 again */
    int32_t answered; /* applied_restitution has been set since the pending contact was reported */
    /* outputs */
    int32_t stuck;
    int32_t open;    /* a stick, or a contact with a stop that yields, goes on and belongs to the present recording */
    int32_t earlier; /* no output: the present contact or stick began before the present recording */
    double displacement, velocity, mass, force, impulse;
    double total_impulse; /* of impacts and summed chatter since the start, N s; without forces */
    double indicator; /* of model exchange; 0 in co-simulation */
    int64_t count, graze_count;
    double last_time, last_phase, last_velocity, stick_start, stick_end, event_time;
} vi_contact;

/* Count an impulse by which another body has hit this point. */
static inline void vi_contact_struck(vi_contact *contact, double time)
{
    contact->count += 1;
    contact->last_time = time;
    contact->impulse = fabs(contact->applied_impulse);
    contact->total_impulse += contact->impulse;
    contact->applied_impulse = 0.0;
}

/* Reset the outputs: no event has happened at this contact yet. */
static inline void vi_contact_clear(vi_contact *contact)
{
    contact->stuck = contact->answered = contact->open = contact->earlier = 0;
    contact->count = contact->graze_count = 0;
    contact->force = contact->impulse = contact->total_impulse = contact->last_velocity = 0.0;
    contact->last_time = contact->last_phase = contact->stick_start = contact->stick_end = NAN;
    contact->event_time = NAN;
}

#endif
