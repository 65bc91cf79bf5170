"""Neural constitutive laws, learned from motion (NCLaw)."""
