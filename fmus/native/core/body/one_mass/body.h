/* A body with stops: flies on the exact flow, meets its stops, chatters, sticks and is released.
 *
 * This is the one place where contact is resolved. State is flat: copying the struct copies the body.
 */
#ifndef VIBROIMPACT_BODY_H
#define VIBROIMPACT_BODY_H

#include <stdbool.h>
#include <stdint.h>

#include "body/budget.h"
#include "body/complaint.h"
#include "body/record.h"
#include "body/step.h"
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

/* Begin at an instant; mode, clock, mass, contacts' parameters and inputs are set. */
void vi_body_start(vi_body *body, vi_instant now, double displacement, double velocity);

/* New inputs (force per unit mass, and slope) from now on. */
void vi_body_hold(vi_body *body, double held, double held_rate);

/* Advance to `target`. See step.h for what may end it earlier. */
vi_step_result vi_body_advance(vi_body *body, vi_instant target, const vi_step_request *request);

/* Say where it stands after VI_STEP_STANDSTILL. */
void vi_body_complain(const vi_body *body, char message[VI_MESSAGE_LENGTH]);

/* Resolve the pending contact with its answer. */
void vi_body_resolve(vi_body *body);

/* Relative acceleration, and the contacts' outputs, at the present instant. */
double vi_body_outputs(vi_body *body);

#endif
