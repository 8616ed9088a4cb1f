/* The two engines that an Oscillator runs on, behind one set of words. */
#ifndef VIBROIMPACT_OSCILLATOR_ENGINE_H
#define VIBROIMPACT_OSCILLATOR_ENGINE_H

#include <stdbool.h>

#include "body/modal/structure_exchange.h"
#include "oscillator.h"

/* Does it run on the engine of structure.h: has a contact a law of force, or does the importer integrate the motion? */
bool oscillator_yields(const oscillator *o);

/* As an importer integrates it. */
vi_exchange_body oscillator_exchange(oscillator *o);

/* Start the forcing's clock; false when the start time cannot be counted in its periods. */
bool oscillator_start_clock(oscillator *o, double start_time, vi_instant *now);

/* Begin at an instant from the start values; the parameters are good. */
void oscillator_start(oscillator *o, vi_instant now);

/* The forcing may have been tuned: go on with it, where it is one that the body can go on with. */
void oscillator_drive(oscillator *o);

/* Spring and dashpot as they are at the present amplitude, until the next step; nothing where they do not depend on it. */
void oscillator_follow_amplitude(oscillator *o);

/* Give the mass the impulses of its contacts, once. */
void oscillator_take_impulses(oscillator *o);

/* Give the inputs to the body from now on. */
void oscillator_hold(oscillator *o);

/* Is the next step the rest of one that ended early for no reason of the motion, under the same inputs? Their slopes, and
 * what is found at the start of a step, then hold on. */
bool oscillator_continues(const oscillator *o);

/* Complains where the step is given up. */
vi_step_result oscillator_advance(oscillator *o, vi_instant target, const vi_step_request *request,
                                  char message[VI_MESSAGE_LENGTH]);

/* Resolve the pending contacts with their answers. */
void oscillator_resolve(oscillator *o);

/* Displacement, velocity and acceleration relative to the base, and the contacts' outputs, at the present instant. */
void oscillator_outputs(oscillator *o, double *displacement, double *velocity, double *acceleration);

vi_instant oscillator_now(const oscillator *o);

/* Does contact k (0-based) wait for the answer of its external law? Several may, at one instant. */
bool oscillator_asks(const oscillator *o, int k);

/* A contact (1-based) that waits for an answer; the one that the last step flew through. 0: none. */
int oscillator_pending(const oscillator *o);
int oscillator_passed(const oscillator *o);

#endif
