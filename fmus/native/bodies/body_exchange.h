/* A body that an importer integrates: model exchange. */
#ifndef VIBROIMPACT_BODY_EXCHANGE_H
#define VIBROIMPACT_BODY_EXCHANGE_H

#include "component.h"

extern const vi_model_exchange vi_body_exchange;

/* Put the event indicators into the outputs of the contacts. */
void vi_body_show_indicators(void *self);

#endif
