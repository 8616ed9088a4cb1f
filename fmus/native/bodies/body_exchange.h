/* Model exchange of a body: the importer integrates it. */
#ifndef VIBROIMPACT_BODY_EXCHANGE_H
#define VIBROIMPACT_BODY_EXCHANGE_H

#include "component.h"

extern const vi_model_exchange vi_body_exchange;

/* Write the event indicators to the outputs of the contacts. */
void vi_body_show_indicators(void *self);

#endif
