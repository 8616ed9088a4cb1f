/* Checks of a body's parameters, inputs and steps; each complains in `message`. */
#ifndef VIBROIMPACT_BODY_CHECK_H
#define VIBROIMPACT_BODY_CHECK_H

#include "body.h"

void vi_body_check_inputs(const vi_body *c, char message[VI_MESSAGE_LENGTH]);

/* Check that stops at one point leave room, and that no rigid stop hides another; the model must be prepared. */
void vi_body_check_points(const vi_body *c, char message[VI_MESSAGE_LENGTH]);

/* Can this step be made? *target: its end. */
bool vi_body_check_step(const vi_body *c, const vi_step_request *request, vi_instant *target,
                        char message[VI_MESSAGE_LENGTH]);

/* Has each contact that asks for an answer received a valid one? */
bool vi_body_check_answers(const vi_body *c, char message[VI_MESSAGE_LENGTH]);

/* Take the law of each contact beyond those in use. False after complaining of their number. */
bool vi_body_use_contacts(vi_body *c, char message[VI_MESSAGE_LENGTH]);

#endif
