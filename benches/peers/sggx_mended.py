"""SGGX micro-flakes for Mitsuba 3 with visible normals drawn in the right frame.

The plugin that comes with Mitsuba 3.9.1 draws them in a transposed frame (its
issue 1728), which its tests do not see because the incoming direction there is
the z axis. Importing this after mi.set_variant() and calling register() makes
phase functions of type "sggx_mended" known.

Formulas: Heitz et al. 2015, "The SGGX microflake distribution".
"""

import drjit as dr
import mitsuba as mi


def _times(s, v):
    """The matrix xx, yy, zz, xy, xz, yz times a vector."""
    return mi.Vector3f(
        s[0] * v.x + s[3] * v.y + s[4] * v.z,
        s[3] * v.x + s[1] * v.y + s[5] * v.z,
        s[4] * v.x + s[5] * v.y + s[2] * v.z,
    )


def _area(s, w):
    """Projected area, the root of w S w."""
    return dr.sqrt(dr.maximum(0.0, dr.dot(w, _times(s, w))))


def _density(s, m):
    """Distribution of normals, by the adjugate: |S|^(3/2) / (pi (m adj(S) m)^2)."""
    adjugate = [
        s[1] * s[2] - s[5] * s[5],
        s[0] * s[2] - s[4] * s[4],
        s[0] * s[1] - s[3] * s[3],
        s[4] * s[5] - s[2] * s[3],
        s[3] * s[5] - s[1] * s[4],
        s[3] * s[4] - s[0] * s[5],
    ]
    det = s[0] * adjugate[0] + s[3] * adjugate[3] + s[4] * adjugate[4]
    form = dr.dot(m, _times(adjugate, m))
    return dr.power(dr.maximum(det, 0.0), 1.5) / (dr.pi * form * form)


def register():
    class SGGXMended(mi.PhaseFunction):
        def __init__(self, props):
            mi.PhaseFunction.__init__(self, props)
            self.volume = props["S"]
            self.m_flags = mi.PhaseFunctionFlags.Anisotropic | mi.PhaseFunctionFlags.Microflake

        def _phase(self, s, wi, wo):
            return 0.25 * _density(s, dr.normalize(wi + wo)) / _area(s, wi)

        def sample(self, ctx, mei, sample1, sample2, active=True):
            s = self.volume.eval_6(mei, active)
            w = mei.wi
            # In a frame whose last axis is w, S = M M^T with M upper
            # triangular; M maps points of a sphere seen from w, uniform on
            # its disk, to visible normals.
            frame = mi.Frame3f(w)
            sx, sy, sz = (_times(s, v) for v in (frame.s, frame.t, frame.n))
            zz = dr.dot(frame.n, sz)
            yy, yz = dr.dot(frame.t, sy), dr.dot(frame.t, sz)
            xx, xy, xz = dr.dot(frame.s, sx), dr.dot(frame.s, sy), dr.dot(frame.s, sz)
            c = dr.sqrt(zz)
            b_z, a_z = yz / c, xz / c
            b_y = dr.sqrt(dr.maximum(1e-20, yy - b_z * b_z))
            a_y = (xy - a_z * b_z) / b_y
            a_x = dr.sqrt(dr.maximum(0.0, xx - a_y * a_y - a_z * a_z))
            u = mi.warp.square_to_cosine_hemisphere(sample2)
            normal = dr.normalize(
                (a_x * u.x + a_y * u.y + a_z * u.z) * frame.s
                + (b_y * u.y + b_z * u.z) * frame.t
                + (c * u.z) * frame.n
            )
            wo = dr.normalize(2.0 * dr.dot(w, normal) * normal - w)
            return wo, mi.Spectrum(1.0), self._phase(s, w, wo)

        def eval_pdf(self, ctx, mei, wo, active=True):
            s = self.volume.eval_6(mei, active)
            phase = self._phase(s, mei.wi, wo)
            return mi.Spectrum(phase), phase

        def projected_area(self, mei, active=True):
            return _area(self.volume.eval_6(mei, active), mei.wi)

        def max_projected_area(self):
            return 1.0

        def to_string(self):
            return "SGGXMended[]"

    make = getattr(mi, "register_phasefunction", None) or mi.register_phase
    make("sggx_mended", SGGXMended)
