/* P(1,1) as a student would write it: closed form, a 2x2 propagator of 16 points a period, secant steps to the stop.
 *
 * Nothing of it is certified: a contact between two points is missed.
 */
#include <math.h>

#define POINTS 16
#define SECANT_STEPS 30

double plain_loop(double damping, double force, double stop, double restitution, double phase, double velocity,
                  long impacts, double *speed)
{
    const double period = 2.0 * acos(-1.0), step = period / POINTS, decay = 0.5 * damping,
                 fast = sqrt(1.0 - decay * decay);
    const double e = exp(-decay * step), c = cos(fast * step), s = sin(fast * step) / fast;
    const double m11 = e * (c + decay * s), m12 = e * s, m21 = -e * s, m22 = e * (c - decay * s);
    /* at resonance the response is amplitude * sin(t) */
    const double along = cos(step), across = sin(step), amplitude = force / damping;
    double t = phase, v = velocity;
    for (long n = 0; n < impacts; n++) {
        double p = amplitude * sin(t), q = amplitude * cos(t), x = stop - p, y = -restitution * v - q, at = stop;
        for (;;) {
            double x1 = m11 * x + m12 * y, y1 = m21 * x + m22 * y;
            double p1 = p * along + q * across, q1 = q * along - p * across;
            if (x1 + p1 >= stop && at < stop) {
                double a = 0.0, fa = at - stop, b = step, fb = x1 + p1 - stop, ex, ey, ep, eq;
                for (int k = 0; k < SECANT_STEPS; k++) {
                    double tau = b == a ? b : b - fb * (b - a) / (fb - fa), g = exp(-decay * tau);
                    double co = cos(fast * tau), si = sin(fast * tau) / fast;
                    ex = g * (co * x + si * (y + decay * x)), ey = g * (co * y - si * (x + decay * y));
                    ep = amplitude * sin(t + tau), eq = amplitude * cos(t + tau);
                    a = b, fa = fb, b = tau, fb = ex + ep - stop;
                    if (fabs(fb) < 1e-15 || fb == fa)
                        break;
                }
                t = fmod(t + b, period), v = ey + eq;
                break;
            }
            t += step, x = x1, y = y1, p = p1, q = q1, at = x + p;
        }
    }
    *speed = v;
    return t;
}
