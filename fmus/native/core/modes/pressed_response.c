#include "modes/pressed_response.h"

#include <math.h>

/* Dynamic stiffness s^2 + D s + W of mode j. */
static vi_complex dynamic_stiffness(const vi_pressed_body *body, vi_complex s, int j)
{
    const double decay = 2.0 * body->decay[j], natural = sqrt(body->square[j]);
    const double detuning = s.re == 0.0 ? (natural - s.im) * (natural + s.im)
                                        : body->square[j] + (s.re - s.im) * (s.re + s.im);
    return (vi_complex){detuning + decay * s.re, 2.0 * s.re * s.im + decay * s.im};
}

/* The mode with the least dynamic stiffness over the square of its part in the point; -1: a node of all modes. */
static int nearest_resonance(const vi_pressed_body *body, vi_complex s)
{
    double least = HUGE_VAL;
    int nearest = -1;
    for (int j = 0; j < body->modes; ++j) {
        const double n = body->shape[0][j], size = vi_complex_size(dynamic_stiffness(body, s, j)) / (n * n);
        if (n != 0.0 && size < least) {
            least = size;
            nearest = j;
        }
    }
    return nearest;
}

void vi_pressed_response(const vi_pressed_body *body, vi_complex s, const vi_complex load[], vi_complex offset,
                         vi_complex q[], vi_complex *force)
{
    const int last = nearest_resonance(body, s);
    const double n = body->shape[0][last];
    const vi_complex least = vi_complex_scale(1.0 / n, dynamic_stiffness(body, s, last));
    const vi_complex whole = vi_complex_scale(1.0 / n, load[last]); /* force = whole - least q[last] */
    const vi_complex z = {body->stiffness[0] + body->damping[0] * s.re, body->damping[0] * s.im};
    vi_complex given = offset, compliance = body->held[0] ? (vi_complex){0.0, 0.0} : vi_complex_invert(z);
    for (int j = 0; j < body->modes; ++j) {
        if (j != last && body->shape[0][j] != 0.0) {
            const vi_complex g = vi_complex_scale(body->shape[0][j], vi_complex_invert(dynamic_stiffness(body, s, j)));
            compliance = vi_complex_add(compliance, vi_complex_scale(body->shape[0][j], g));
            given = vi_complex_subtract(given, vi_complex_multiply(g, load[j]));
        }
    }
    given = vi_complex_add(given, vi_complex_multiply(compliance, whole));
    vi_complex held = vi_complex_multiply(compliance, least);
    held.re += n;
    q[last] = vi_complex_divide(given, held);
    *force = vi_complex_subtract(whole, vi_complex_multiply(least, q[last]));
    for (int j = 0; j < body->modes; ++j) {
        if (j != last) {
            const vi_complex pressed = vi_complex_subtract(load[j], vi_complex_scale(body->shape[0][j], *force));
            q[j] = vi_complex_divide(pressed, dynamic_stiffness(body, s, j));
        }
    }
}
