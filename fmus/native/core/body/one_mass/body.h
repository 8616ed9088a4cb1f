/* A mass with rigid stops: flies on the exact flow, meets its stops, chatters, sticks and is released. */
#ifndef VIBROIMPACT_BODY_H
#define VIBROIMPACT_BODY_H

#include "body/complaint.h"
#include "body/one_mass/body_state.h"
#include "body/step.h"

/* Begin at an instant; mode, clock, mass, contacts' parameters and inputs are set. */
void vi_body_start(vi_body *body, vi_instant now, double displacement, double velocity);

/* New inputs (force per unit mass, and slope) from now on. */
void vi_body_hold(vi_body *body, double held, double held_rate);

/* Another harmonic force from now on, at the phase that it has: amplitude per unit mass, angular frequency > 0 where the
 * clock counts one. Displacement and velocity stay. */
void vi_body_drive(vi_body *body, double force, double angular_frequency);

/* Advance to `target`. See step.h for what may end it earlier. */
vi_step_result vi_body_advance(vi_body *body, vi_instant target, const vi_step_request *request);

/* Say where it stands after VI_STEP_STANDSTILL. */
void vi_body_complain(const vi_body *body, char message[VI_MESSAGE_LENGTH]);

/* Resolve the pending contact with its answer. */
void vi_body_resolve(vi_body *body);

/* Give the body the impulses that its contacts have been given, once. One that rests on a stop leaves it, or hits it as
 * the next step begins. */
void vi_body_take_impulses(vi_body *body);

/* Relative acceleration, and the contacts' outputs, at the present instant. */
double vi_body_outputs(vi_body *body);

#endif
