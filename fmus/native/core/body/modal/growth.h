/* Growth of a structure's motion by negative stiffness or damping: equations.md 1.9. */
#ifndef VIBROIMPACT_MODAL_GROWTH_H
#define VIBROIMPACT_MODAL_GROWTH_H

#include <math.h>

#include "body/modal/state.h"

/* Rate above which no motion of the model grows, 1/s; 0 where the energy of no motion grows. */
double vi_growth_of(const vi_structure_model *model);

/* Longest flight of a motion that grows, s: its bounds hold for twice this time and are e^2 as large. */
static inline double vi_growth_reach(const vi_structure_model *model)
{
    return vi_structure_grows(model) ? 1.0 / model->growth : HUGE_VAL;
}

#endif
