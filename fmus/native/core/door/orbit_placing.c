#include "door/orbit_placing.h"

#include <math.h>

/* Share of a mode's displacement that no other mode gives to the contacts, below which its position is not known. */
static const double ADRIFT = 1e-9;

void vi_orbit_answer(const vi_orbit_response *response, int i, int k, double g[3])
{
    const vi_orbit_body *body = response->body;
    const int32_t *contact = response->train->contact;
    const double *shape = body->shape + (ptrdiff_t)contact[i] * body->modes;
    double x[VI_MODES], v[VI_MODES], drag[VI_MODES];
    vi_orbit_train_answer(response, contact[k], vi_orbit_since(response, i, k), x, v);
    vi_orbit_drag(response, v, drag);
    const double factor = (1.0 + body->restitution[contact[k]]) * body->direction[contact[i]]
                          * body->direction[contact[k]];
    g[0] = g[1] = g[2] = 0.0;
    for (int j = 0; j < body->modes; ++j) {
        const double weight = factor * shape[j];
        g[0] += weight * x[j];
        g[1] += weight * v[j];
        g[2] += weight * (vi_orbit_evening(response, contact[k], j) - response->mode[j].stiffness * x[j] - drag[j]);
    }
}

bool vi_orbit_find_placing(const vi_orbit_response *response, vi_orbit_placing *found)
{
    const vi_orbit_body *body = response->body;
    const int n = response->train->impacts;
    for (int l = 0; l < response->loose; ++l) {
        double *column = found->q[l], size = 0.0, left = 0.0;
        for (int i = 0; i < n; ++i) {
            const int32_t contact = response->train->contact[i];
            column[i] = body->direction[contact] * body->shape[(ptrdiff_t)contact * body->modes + l];
            size += column[i] * column[i];
        }
        for (int before = 0; before < l; ++before) {
            double along = 0.0;
            for (int i = 0; i < n; ++i) {
                along += found->q[before][i] * column[i];
            }
            for (int i = 0; i < n; ++i) {
                column[i] -= along * found->q[before][i];
            }
            found->r[before][l] = along;
        }
        for (int i = 0; i < n; ++i) {
            left += column[i] * column[i];
        }
        if (!(left > ADRIFT * ADRIFT * size)) {
            return false;
        }
        found->r[l][l] = sqrt(left);
        for (int i = 0; i < n; ++i) {
            column[i] /= found->r[l][l];
        }
    }
    return true;
}

void vi_orbit_put_in_place(const vi_orbit_response *response, const vi_orbit_placing *placed, double distance[],
                           int stride, double place[])
{
    const int n = response->train->impacts;
    for (int l = 0; l < response->loose; ++l) {
        place[l] = 0.0;
        for (int i = 0; i < n; ++i) {
            place[l] -= placed->q[l][i] * distance[i * stride];
        }
        for (int i = 0; i < n; ++i) {
            distance[i * stride] += placed->q[l][i] * place[l];
        }
    }
    for (int l = response->loose - 1; l >= 0; --l) {
        for (int later = l + 1; later < response->loose; ++later) {
            place[l] -= placed->r[l][later] * place[later];
        }
        place[l] /= placed->r[l][l];
    }
}

void vi_orbit_drift(const vi_orbit_response *response, const double speed[], double held, double distance[],
                    int stride)
{
    const vi_orbit_body *body = response->body;
    const int n = response->train->impacts;
    for (int l = 0; l < response->loose; ++l) {
        double momentum = held * response->length * body->held[l];
        for (int k = 0; k < n; ++k) {
            const int32_t contact = response->train->contact[k];
            momentum -= (1.0 + body->restitution[contact]) * body->direction[contact] * speed[k]
                        * body->impulse[(ptrdiff_t)contact * body->modes + l];
        }
        for (int i = 0; i < n; ++i) {
            const int32_t contact = response->train->contact[i];
            distance[i * stride] += body->direction[contact] * body->shape[(ptrdiff_t)contact * body->modes + l]
                                    * momentum / body->angular_frequency;
        }
    }
}

void vi_orbit_place_states(const vi_orbit_response *response, const vi_orbit_placing *placed, double state[])
{
    const vi_orbit_body *body = response->body;
    const int n = response->train->impacts;
    double distance[VI_ORBIT_IMPACTS], place[VI_MODES];
    for (int i = 0; i < n; ++i) {
        const int32_t contact = response->train->contact[i];
        double stop[3];
        vi_orbit_stop(body, contact, response->train->phase[i], stop);
        double at = -body->position[contact] - stop[0];
        for (int j = 0; j < body->modes; ++j) {
            at += body->shape[(ptrdiff_t)contact * body->modes + j] * state[(ptrdiff_t)i * 2 * body->modes + j];
        }
        distance[i] = body->direction[contact] * at;
    }
    vi_orbit_put_in_place(response, placed, distance, 1, place);
    for (int i = 0; i < n; ++i) {
        for (int l = 0; l < response->loose; ++l) {
            state[(ptrdiff_t)i * 2 * body->modes + l] += place[l];
        }
    }
}
