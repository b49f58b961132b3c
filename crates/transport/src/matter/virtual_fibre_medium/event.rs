//! The kinds of events of virtual fibres.

/// What a collision with a fibre of the medium is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VirtualFibreEvent {
    /// The surface of one virtual cylinder: density is looked up at its axis,
    /// extinction is multiplied by packing factors ([`crate::PackingFactors`]), light
    /// scatters in the near field and leaves where the cylinder lets it out
    /// ([`organza_scatter::PackedEvent`]). Wants an
    /// octree with the length of a fibre at its axis
    /// ([`organza_volume::FibreFootprint::Axis`]).
    ///
    /// The tangent that takes the ray to the axis is the mean one of what lies
    /// where the ray is, or, beside all matter, of the densest voxel around;
    /// population and tangent of the event are drawn from what lies at the axis.
    /// For parallel fibres this is exact; spread moves the look-up by a radius
    /// times the spread.
    #[default]
    Packed,
    /// A point where the ray is, in the far field.
    Plain,
}
