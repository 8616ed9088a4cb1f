/* The response of a body to loads while it rests on stops, for any coupling of its modes. */
#ifndef VIBROIMPACT_COUPLED_RESPONSE_H
#define VIBROIMPACT_COUPLED_RESPONSE_H

#include "modes/pressed_terms.h"

enum { VI_UNKNOWNS = VI_MODES + VI_PORTS };

/* The equations for loads of the form Re(load e^(s t)), factored by Gaussian elimination with partial pivoting. */
typedef struct {
    int32_t known;
    int32_t unknowns;
    vi_complex s;
    int32_t row[VI_UNKNOWNS];
    vi_complex factor[VI_UNKNOWNS][VI_UNKNOWNS];
} vi_coupled_equations;

void vi_coupled_equations_find(vi_coupled_equations *equations, const vi_pressed_body *body, vi_complex s);

/* Solve (s^2 + s D + W) q + sum n_k F_k = load and n_k.q - F_k / (stiffness + damping s) = offset_k. The second
 * equation of a held contact has no F_k. */
void vi_coupled_response(const vi_coupled_equations *equations, const vi_pressed_body *body, const vi_complex load[],
                         const vi_complex offset[], vi_complex q[], vi_complex force[]);

#endif
