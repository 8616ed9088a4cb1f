/* Watched points of an FMU for model exchange: a step of CVODE ends where one meets its surface or its level. */
#ifndef VIBROIMPACT_MODEL_EXCHANGE_WATCHES_H
#define VIBROIMPACT_MODEL_EXCHANGE_WATCHES_H

#include <stdbool.h>

#include "door/model_exchange_calls.h"

/* Set the levels of contacts for a step that begins at the present point. */
int vi_exchange_mark_watches(vi_exchange *exchange);
/* Write a function of each watch: the distance from its level, or the force of a stop that presses. */
void vi_exchange_watch_roots(const vi_exchange *exchange, double roots[]);
/* Judge the roots at the end of a step of CVODE, if it has some: `event` becomes whether one is an event. */
int vi_exchange_judge_roots(vi_exchange *exchange, bool has_roots, bool *event);
/* Let the roots of the last step begin and end the forces of stops that yield. */
void vi_exchange_change_contacts(vi_exchange *exchange);
/* Forget the touching of contact points that have moved away. */
int vi_exchange_follow_watches(vi_exchange *exchange);
/* Keep the states at the instants up to the present time; `by_solver`: CVODE has made the step, else they are constant. */
int vi_exchange_keep_samples(vi_exchange *exchange, bool by_solver);

#endif
