/* A mass between rigid stops: its state, and questions about the present instant. Copying the struct copies the body. */
#ifndef VIBROIMPACT_BODY_STATE_H
#define VIBROIMPACT_BODY_STATE_H

#include <stdbool.h>
#include <stdint.h>

#include "body/budget.h"
#include "body/record.h"
#include "contact/contact.h"
#include "motion/clock.h"
#include "motion/flow.h"
#include "motion/origin.h"

enum { VI_BODY_CONTACTS = 2 };

typedef struct {
    /* set up by the component */
    vi_mode mode;
    vi_clock clock;
    double mass;
    int64_t impact_limit; /* most events of contacts since the start; 0: no limit */
    /* state */
    vi_instant now;
    vi_standstill standstill;
    vi_budget budget;
    double displacement, velocity;
    vi_origin origin;
    double held, held_rate; /* input per unit mass at held_since, and its slope */
    vi_instant held_since;
    int32_t stuck;          /* 0, or the contact (1-based) that the body rests on */
    int32_t leaving;        /* just released: displacement on the stop, velocity and acceleration 0 */
    int32_t pending;        /* 0, or the contact (1-based) whose external law must answer */
    int32_t passed;         /* 0, or the external contact that the last step passed through (FMI 2.0) */
    double fastest_impact;  /* largest approach since the last stick, m/s: the scale of a chatter sequence */
    int64_t low_impacts;    /* impacts in a row that are far below that scale */
    double tail_impulse;    /* of the chatter summed at the last stick, N s */
    vi_contact contacts[VI_BODY_CONTACTS];
    vi_record record; /* last */
} vi_body;

/* +1 for a stop above the motion, -1 for one below. */
static inline double vi_body_direction(const vi_body *body, int k)
{
    return vi_contact_direction(body->contacts[k].side);
}

/* Is this contact looked for? */
static inline bool vi_body_watched(const vi_body *body, int k)
{
    return vi_contact_law_has_stop(body->contacts[k].law.law) && !body->passed;
}

/* Held input per unit mass at the present instant, m/s^2. */
double vi_body_held_now(const vi_body *body);

/* Forcing phase at the present instant. */
vi_phase vi_body_phase_now(const vi_body *body);

/* A displacement that is known not to be beyond a stop, without the rounding that may put it there. */
double vi_body_within(const vi_body *body, double displacement);

/* Rounding of the contact acceleration of a body held at `position`, m/s^2. */
double vi_body_pressure_noise(const vi_body *body, double position);

#endif
